"""The one exception that says "this scene cannot be rendered"."""


class SceneError(Exception):
    """Something of the user's that prevents a render; the message is one line that names it and the remedy."""
