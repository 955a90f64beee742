/* Mark the voxel that a surface passes through at the centre of this pixel, looking along one axis of the grid. */
#include "frame/voxel_cell_lib.glsl"

/* Voxels. A plane exactly between two layers would fall into one or the other by rounding: it goes up. */
const float VOXEL_NUDGE = 1e-3;

void main()
{
  out_nothing = vec4(0.0);
  ivec3 size = ivec3(voxel_grid.size);
  int depth = int(floor((0.5 * v_depth + 0.5) * float(size[pc_axis]) + VOXEL_NUDGE));
  ivec2 across = ivec2(gl_FragCoord.xy);
  ivec3 voxel = pc_axis == 0   ? ivec3(depth, across)
                : pc_axis == 1 ? ivec3(across.y, depth, across.x)
                               : ivec3(across, depth);
  if (any(lessThan(voxel, ivec3(0))) || any(greaterThanEqual(voxel, size))) {
    return;
  }
  /* The first to mark a texel marks its cell a level up. */
  for (int level = 0; level < VOXEL_LEVELS; level++) {
    ivec3 cell = voxel >> (2 * level);
    if (imageAtomicOr(voxel_img, voxel_texel(cell, level), 1u << voxel_bit(cell)) != 0u) {
      break;
    }
  }
}
