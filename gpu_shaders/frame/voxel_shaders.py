"""The grid of occupied voxels for the shaders: where it lies, and the draw that fills it."""

from ...device.shader import Image, Shader
from ...device.structs import Struct
from .shaders import MESH_SAMPLERS
from .structs import INSTANCE, MESH_DEFINES

MOST_OUTER_GRIDS = 5

# A voxel is one bit. 4 x 4 x 4 of them make a brick: two texels side by side, the lower and the upper two layers. A
# cell of the next level is a brick of this one, and 4 x 4 x 4 cells make a brick again. All levels lie in one volume,
# each above the one before, and so do all grids (voxel_cell_lib.glsl).
VOXEL_GRID = Struct(
    "VoxelGrid",
    origin="vec3",  # lower corner, world
    edge="float",  # metres of one voxel
    size="vec3",  # voxels along each axis
    slice_1="int",  # the first slice of the volume that holds level 1, and level 2
    slice_2="int",
    outer_count="int",  # ever wider grids around this one: place_1 and size_1 are the next, and so on
    **{f"place_{number}": "vec4" for number in range(1, MOST_OUTER_GRIDS + 1)},  # lower corner, metres of one voxel
    **{f"size_{number}": "vec4" for number in range(1, MOST_OUTER_GRIDS + 1)},  # voxels, first slice of the volume
)

VOXEL_SAMPLERS = {"voxel_tx": "UINT_3D"}

VOXEL_DRAW = Shader(
    name="voxel_draw",
    vertex="frame/shadow_draw_vert.glsl",
    fragment="frame/voxel_draw_frag.glsl",
    varyings={"v_depth": "FLOAT"},
    outputs={"out_nothing": "VEC4"},
    samplers=MESH_SAMPLERS,
    images={"voxel_img": Image("R32UI", "UINT_3D_ATOMIC")},
    uniforms={"voxel_grid": VOXEL_GRID},
    structs=(INSTANCE,),
    constants={"pc_clip_from_world": "MAT4", "pc_first_chunk": "INT", "pc_axis": "INT", "pc_grid": "INT"},
    defines=MESH_DEFINES,
)
