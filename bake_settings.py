"""Settings of the operator that bakes light transfer (scene.rebound): no picture depends on them.

Named as the fields of bake.job.BakeSettings, with "bake_" before them.
"""

from __future__ import annotations

from .gpu_shaders.technique import Item, Setting

BAKE_SETTINGS = (
    Setting(
        "bake_kind",
        "ENUM",
        "Basis",
        "What is baked of each object: which light of the surroundings it can tell apart, and what it shows of it",
        "DIFFUSE",
        items=(
            Item("DIFFUSE", "Soft, Diffuse", "Spherical harmonics of what matt surfaces receive, bounces included"),
            Item(
                "GLOSSY",
                "Soft, Glossy",
                "Spherical harmonics of what arrives from every direction: reflections too. A matrix a vertex, "
                "compressed; slower to bake",
            ),
            Item("WAVELET", "Sharp, Diffuse", "Haar wavelets: sharp shadows of small bright parts of the sky"),
            Item(
                "WAVELET_GLOSSY",
                "Sharp, Glossy",
                "Haar wavelets: sharp shadows, also in reflections of the roughness that the object's material has "
                "when it is baked. Much slower to bake, much larger files",
            ),
        ),
    ),
    Setting(
        "bake_bands",
        "INT",
        "Bands",
        "Detail of the light that is told apart, as orders of spherical harmonics; their square is the number of "
        "terms. Higher makes shadows less soft, at the cost of time and memory; lower is quicker",
        5,
        minimum=2,
        maximum=6,
        unit="bands",
    ),
    Setting(
        "bake_result_bands",
        "INT",
        "Reflected Bands",
        "Glossy: detail of what surfaces reflect. Higher makes reflections less soft, at the cost of time and memory; "
        "lower is quicker",
        5,
        minimum=2,
        maximum=6,
        unit="bands",
    ),
    Setting(
        "bake_directions",
        "INT",
        "Directions",
        "Rays from each vertex. More finds finer shadows with less error, at the cost of time in proportion",
        1024,
        minimum=16,
        maximum=65536,
        unit="rays a vertex",
    ),
    Setting(
        "bake_shadows", "BOOL", "Shadows", "Whether surfaces block light. Off bakes in no time, without bounces", True
    ),
    Setting(
        "bake_bounces",
        "INT",
        "Bounces",
        "How often light goes on by way of other surfaces; metals mirror it on. More is brighter and truer in corners, "
        "at the cost of time, and more of it where there is metal; at 0 there are shadows only",
        1,
        minimum=0,
        maximum=16,
        unit="bounces",
    ),
    Setting(
        "bake_points",
        "INT",
        "Detail Points",
        "At most so many points inside the triangles of an object, where its vertices do not tell what lies between "
        "them: a shadow in the middle of a floor of one square. More shows sharper shadows, at the cost of time and "
        "memory in proportion to those that are found; 0 bakes vertices alone. The mesh stays as it is",
        2048,
        minimum=0,
        maximum=262144,
        unit="points an object",
    ),
    Setting(
        "bake_detail",
        "FLOAT",
        "Detail Error",
        "Which error between the vertices is left alone, as a part of what an open place receives. Higher is quicker "
        "and takes less memory; lower takes more of Detail Points, for shadows with less blur",
        0.05,
        minimum=0.0,
        maximum=1.0,
        unit="parts of what an open place receives",
        soft_maximum=0.2,
    ),
    Setting(
        "bake_error",
        "FLOAT",
        "Error",
        "Glossy: how far compressed matrices, of sharp ones the bounces, may be off, as a part of their mean length. "
        "Higher takes less memory, lower is truer at the cost of memory",
        0.01,
        minimum=0.0,
        maximum=1.0,
        unit="parts of the length",
        soft_maximum=0.1,
    ),
    Setting(
        "bake_texels",
        "ENUM",
        "Cube Map",
        "Wavelets: how finely the light of the surroundings is told apart",
        "32",
        items=(
            Item("32", "6 x 32²", "Shadows 3 degrees sharp"),
            Item("64", "6 x 64²", "Shadows 1.5 degrees sharp, four times the time and memory of bakes"),
        ),
    ),
    Setting(
        "bake_keep",
        "FLOAT",
        "Kept Energy",
        "Wavelets: which part of each vertex' transfer is kept. Higher is truer at the cost of memory; lower leaves "
        "the smallest terms out. Of a lobe ten times as much is left out",
        0.999,
        minimum=0.5,
        maximum=1.0,
        unit="parts of the squared sum",
    ),
    Setting(
        "bake_lobe",
        "ENUM",
        "Baked Lobe",
        "Sharp, glossy: by which lobe the object mirrors what arrives",
        "GGX",
        items=(
            Item("GGX", "GGX", "The lobe of the materials"),
            Item("PHONG", "Phong", "The same round lobe from all sides, as wide as GGX"),
        ),
    ),
    Setting(
        "bake_lobe_terms",
        "INT",
        "Lobe Terms",
        "Sharp, glossy: products of a function of the light and one of the view that make up the lobe. Higher is truer "
        "from roughness 0.5 down, at the cost of time and memory; lower shows softer reflections",
        24,
        minimum=1,
        maximum=64,
        unit="terms",
    ),
    Setting(
        "bake_pack",
        "BOOL",
        "Pack",
        "Keep bakes in the .blend. Off writes a file for each object into a folder beside the .blend",
        False,
    ),
)
