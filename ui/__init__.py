"""What the user sees: settings as Blender properties, panels, and which of Blender's own are shown with Rebound."""
