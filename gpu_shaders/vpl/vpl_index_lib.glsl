/* Which point of the cache, or of the emitters, lies near: a cube of VPL_INDEX cells along a side around the scene, six
 * sides of each cell for the ways that surfaces face; and ever wider cubes where huge objects reach beyond it. `cube` is its
 * lower corner and cells a metre. A flat texture has the six sides side by side, the cells' layers one above the other,
 * and the levels above one another again. A texel is the point's number and one, 0 for none, and its place in cells. */
#include "lib/math_lib.glsl"

const ivec2 INDEX_SIZE = ivec2(6 * VPL_INDEX, VPL_INDEX *VPL_INDEX);

/* In cells. */
vec3 index_place(vec4 cube, vec3 P)
{
  return (P - cube.xyz) * cube.w;
}

int index_side(int axis, float toward)
{
  return 2 * axis + (toward < 0.0 ? 1 : 0);
}

ivec2 index_texel(ivec3 cell, int side)
{
  return ivec2(cell.x + VPL_INDEX * side, cell.y + VPL_INDEX * cell.z);
}

/* The point that cell and side of `place` hold in a level, or -1. */
int index_point(sampler2D index_tx, int level, vec3 place, int side)
{
  ivec3 cell = clamp(ivec3(floor(place)), ivec3(0), ivec3(VPL_INDEX - 1));
  return int(texelFetch(index_tx, index_texel(cell, side) + ivec2(0, level * INDEX_SIZE.y), 0).x) - 1;
}

/* Texel of a point of the tile whose lower left texel and side are `tile`. A side of 0, where there are no points, is asked
 * too, by shaders that skip no branch: nothing may be divided by it. */
ivec2 index_atlas_texel(vec3 tile, int point)
{
  int side = max(int(tile.z), 1);
  return ivec2(tile.xy) + ivec2(point % side, point / side);
}

vec3 index_radiance(sampler2D position_area_tx, sampler2D flux_tx, ivec2 texel)
{
  return texelFetch(flux_tx, texel, 0).rgb / (MATH_PI * texelFetch(position_area_tx, texel, 0).w);
}
