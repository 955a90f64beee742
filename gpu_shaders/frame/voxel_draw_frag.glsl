/* Mark the voxel that a surface passes through at the centre of this pixel, looking along one axis of the grid. */
#include "frame/voxel_cell_lib.glsl"

/* Voxels. A plane exactly between two layers would fall into one or the other by rounding: it goes up. */
const float VOXEL_NUDGE = 1e-3;

void main()
{
  out_nothing = vec4(0.0);
  VoxelPlace place = voxel_place(pc_grid);
  float depth = (0.5 * v_depth + 0.5) * place.size[pc_axis] + VOXEL_NUDGE;
  vec2 across = gl_FragCoord.xy;
  vec3 at = pc_axis == 0 ? vec3(depth, across) : pc_axis == 1 ? vec3(across.y, depth, across.x) : vec3(across, depth);
  ivec3 voxel = ivec3(floor(at));
  if (any(lessThan(voxel, ivec3(0))) || any(greaterThanEqual(voxel, ivec3(place.size)))) {
    return;
  }
  /* Rays ask a grid only around the one inside it. Beside that one's box they start in voxels that it cuts. */
  if (pc_grid > 0 && voxel_place_holds(voxel_place(pc_grid - 1), place.origin + place.edge * at)) {
    return;
  }
  /* The first to mark a texel marks its cell a level up. */
  for (int level = 0; level < VOXEL_LEVELS; level++) {
    ivec3 cell = voxel >> (2 * level);
    if (imageAtomicOr(voxel_img, voxel_texel(place, cell, level), 1u << voxel_bit(cell)) != 0u) {
      break;
    }
  }
}
