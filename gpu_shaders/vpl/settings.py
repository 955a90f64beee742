"""What a user can choose of virtual point lights."""

from ..technique import Item, Setting

SETTINGS = (
    Setting(
        "scale",
        "ENUM",
        "Resolution",
        "Pixels that gather bounced light for themselves; the others take it from those around that lie on the same "
        "surface. Coarser is faster, at the cost of detail in the bounce on small and curved things",
        "HALF",
        viewport_default="QUARTER",
        items=(
            Item("FULL", "1:1", "Every pixel"),
            Item("HALF", "1:2", "Every second pixel of every second row"),
            Item("QUARTER", "1:4", "Every fourth pixel of every fourth row"),
            Item("EIGHTH", "1:8", "Every eighth pixel of every eighth row"),
        ),
    ),
    Setting(
        "coarser_in_motion",
        "BOOL",
        "Coarser in Motion",
        "In viewports, half the resolution of bounced light along each side in pictures of a view or scene that "
        "changed; the picture sharpens as soon as it rests. Off is as sharp in motion, at the cost of fluency",
        True,
    ),
    Setting(
        "resolution",
        "INT",
        "Map Resolution",
        "Texels along a side of each light's map. Higher keeps small and touching surfaces apart, at the cost of "
        "memory and of time when lights or objects move",
        256,
        viewport_default=256,
        minimum=64,
        maximum=2048,
        unit="texels",
        panel="Virtual Lights",
    ),
    Setting(
        "maps_at_once",
        "INT",
        "Maps at Once",
        "Lights' maps drawn anew for one picture of a moving view, those that wait longest first; 0 for all. Fewer "
        "keeps a scene of many lights fluent while objects move, at the cost of light that follows some pictures later",
        0,
        viewport_default=16,
        minimum=0,
        maximum=4096,
        unit="maps",
        panel="Virtual Lights",
    ),
    Setting(
        "pool",
        "INT",
        "Virtual Lights",
        "Virtual point lights chosen from all sources for each sample. More is less alike noise in neighbouring "
        "pixels, at the cost of time that does not depend on the picture's size",
        8192,
        viewport_default=4096,
        minimum=64,
        maximum=262144,
        unit="lights",
        panel="Virtual Lights",
    ),
    Setting(
        "candidates",
        "INT",
        "Candidates",
        "Virtual lights that a pixel looks at in one sample before it traces a ray to one of them. More is less noise "
        "a sample, at the cost of time",
        16,
        viewport_default=8,
        minimum=1,
        maximum=1024,
        unit="lights",
        panel="Virtual Lights",
    ),
    Setting(
        "bounces",
        "ENUM",
        "Bounces",
        "How often light is reflected before it reaches what the camera sees",
        "MANY",
        viewport_default="MANY",
        items=(
            Item("ONE", "1", "Light that was reflected once: quickest, and darker than life in closed rooms"),
            Item("MANY", "Many", "Light goes on until nothing is left of it, at the cost of time"),
        ),
    ),
    Setting(
        "cache_rows",
        "INT",
        "Cache Updates",
        "How many 64ths of the points that hold light for further bounces gather in each sample. More follows changes "
        "sooner and is calmer, at the cost of time",
        64,
        viewport_default=4,
        minimum=1,
        maximum=64,
        unit="rows of 64 points",
        panel="Further Bounces",
    ),
    Setting(
        "voxels",
        "INT",
        "Voxels",
        "Voxels along the longest side of the scene, through which rays test what is hidden. More keeps thin gaps and "
        "contacts open, at the cost of memory and of time when objects move",
        512,
        viewport_default=256,
        minimum=64,
        maximum=1024,
        unit="voxels",
        panel="Occlusion",
    ),
    Setting(
        "reuse",
        "BOOL",
        "Reuse",
        "Keep what samples and, in viewports, the pictures before have found, where they show the same surfaces. On is "
        "calm from the first pictures of a moving view, and light lags behind by some; off knows nothing of others",
        True,
        viewport_default=True,
        panel="Reuse and Denoising",
    ),
    Setting(
        "denoise",
        "BOOL",
        "Denoise",
        "Smooth the bounced light of neighbouring pixels of one surface as far as its noise goes. On is clean at once; "
        "off keeps the noise, and the finest detail",
        True,
        viewport_default=True,
        panel="Reuse and Denoising",
    ),
    Setting(
        "bound",
        "BOOL",
        "Bound",
        "Take a virtual light for a disc of the size that it stands for. Off takes it for a point: contacts are a "
        "little brighter, and much noisier",
        True,
        panel="Virtual Lights",
    ),
    Setting(
        "lobe",
        "FLOAT",
        "Least Roughness of Bounces",
        "Glossy surfaces send light on as if they were at least this rough. Lower is truer to caustics, at the cost of "
        "noise; higher spreads them",
        0.25,
        minimum=0.0,
        maximum=1.0,
        unit="roughness",
        panel="Reflections",
    ),
    Setting(
        "occlusion",
        "ENUM",
        "Occlusion",
        "What blocks bounced light",
        "CONTACTS",
        items=(
            Item("NONE", "Nothing", "Light passes walls: to see what occlusion changes"),
            Item("VOXELS", "Voxels", "All of the scene, as coarse as its voxels"),
            Item(
                "CONTACTS",
                "Voxels and Contacts",
                "All of the scene, and what the camera sees closer than the voxels can tell, at the cost of some time",
            ),
        ),
        panel="Occlusion",
    ),
)
