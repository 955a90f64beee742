"""Tables that the frame's shaders read, and the numbers in them that have names: one declaration for numpy and GLSL."""

from ...device.structs import Struct
from ...scene.data import LightKind, Visibility
from ..materials import VALUE_WIDTH
from .maps import FAR_BITS, NEAR_BITS
from .mesh_pages import PAGE_WIDTH

LIGHT_KINDS = {kind: number for number, kind in enumerate(LightKind)}

LIGHT_DEFINES = tuple((f"LIGHT_{kind.name}", str(number)) for kind, number in LIGHT_KINDS.items())
MAP_DEFINES = (("MAP_NEAR_BITS", str(NEAR_BITS)), ("MAP_FAR_BITS", str(FAR_BITS)))

INSTANCE = Struct(
    "Instance",
    world_from_object="mat4",
    color="vec4",  # what Object Info tells of it, as `random` and `index`
    texture_origin="vec3",  # generated coordinates: (object_position - texture_origin) * texture_scale
    random="float",
    texture_scale="vec3",
    index="float",
    visibility="int",  # scene.data.Visibility
)

VISIBILITY_DEFINES = tuple((f"VISIBILITY_{flag.name}", str(flag.value)) for flag in Visibility)

# What a vertex shader finds of a mesh at once, and what the last of a mesh may be short of.
CHUNK_TRIANGLES = 16
CHUNK_CORNERS = 3 * CHUNK_TRIANGLES
MESH_DEFINES = (
    ("CHUNK_TRIANGLES", str(CHUNK_TRIANGLES)),
    ("CHUNK_SHIFT", str(CHUNK_TRIANGLES.bit_length() - 1)),
    ("CHUNK_ROW", str(VALUE_WIDTH)),
    ("MESH_PAGE_WIDTH", str(PAGE_WIDTH)),
)

MATERIAL = Struct(
    "Material",
    base_color="vec3",
    metallic="float",  # how much of base_color is specular reflectance, the rest is diffuse
    emission="vec3",  # radiance, W/(m² sr)
    roughness="float",
    specular="vec3",  # reflectance at normal incidence of the dielectric part, 0: none
    layered="float",  # how much of `specular` lies over the diffuse part and takes from it
    index="float",
    first_value="int",  # of its graph: a texel of value_tx
)

# The camera, for materials that ask where they are seen.
MATERIAL_VIEW = Struct("MaterialView", camera_from_world="mat4", window_from_world="mat4")

LIGHT = Struct(
    "Light",
    position="vec3",  # the emitter's centre
    kind="int",  # LIGHT_KINDS
    axis_x="vec3",  # the light's own axes in the world, unit, it looks down -axis_z; spot: rows of object-from-world
    spot_cosine="float",  # cosine of half the cone; sun: of half its angle
    axis_y="vec3",
    spot_smooth="float",  # 1 / (blend (1 - spot_cosine))
    axis_z="vec3",
    soft_radius_squared="float",  # point, spot: a disc that turns to the receiver: its radius squared; a sphere: 0
    intensity="vec3",  # W/sr, sun: W/m²
    face_count="int",  # shadow map faces, 0: casts no shadow
    source="vec3",  # this frame's point on the emitter; sun: unit direction to it
    first_face="int",
    filtered="int",  # 1: PCSS from the centre of a sized emitter, 0: the map was drawn from `source`
    half_size="vec2",  # area: half extents, metres
    spread_tangent="float",  # area: tangent of half the spread, -1: none
    spread_normalize="float",
    emitter_radius="float",  # emitter radius for PCSS, metres; sun: tangent of half the angle
    round_shape="int",  # area: 1 for disk and ellipse
    specular_intensity="vec3",  # as `intensity`, for what surfaces mirror
)

MAP_FACE = Struct(
    "MapFace",
    face_from_world="mat4",  # rigid: x right, y up, z away from the light, metres
    scale="vec2",  # tile coordinates = 1/2 + 1/2 scale * (xy / z, orthographic: xy)
    origin="vec2",  # lower left texel of the tile in the atlas
    far="float",  # metres
    near="float",
    tile="float",  # texels along a side
    perspective="int",
)
