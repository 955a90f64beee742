/* How much of its surroundings an emitter's points cover: a table of cells of the world, six sides of each, found by their
 * hash. It lies in the index's texture behind all of its levels, four cells a texel: the area of the points in the cell as
 * seen along the side's axis, m^2. Cells are as wide as some points lie apart, and no smaller than voxels. */
#include "vpl/vpl_index_lib.glsl"

const ivec2 COVER_SIZE = ivec2(6 * VPL_INDEX, VPL_INDEX *VPL_INDEX);
/* Points along a side of a cell that an emitter covers, at least. */
const float COVER_POINTS = 4.0;

/* The width of cells for points of this area each, metres, is 2 to the power of this. */
int cover_scale(float area, float voxel)
{
  return int(ceil(log2(max(COVER_POINTS * sqrt(area), voxel))));
}

ivec3 cover_cell(vec3 P, int scale)
{
  return ivec3(floor(P * exp2(-float(scale))));
}

/* Texel, in the part of the texture, and which of its four numbers (a permutation of M. E. O'Neill's PCG, 2014). */
ivec3 cover_place(ivec3 cell, int scale, int level, int side)
{
  uint key = uint(cell.x) * 73856093u + uint(cell.y) * 19349663u + uint(cell.z) * 83492791u;
  key += uint((scale + 64) * 64 + level * 8 + side) * 2654435769u;
  key = ((key >> ((key >> 28u) + 4u)) ^ key) * 277803737u;
  key = (key >> 22u) ^ key;
  uint texel = (key >> 2u) % uint(COVER_SIZE.x * COVER_SIZE.y);
  return ivec3(int(texel) % COVER_SIZE.x, int(texel) / COVER_SIZE.x, int(key & 3u));
}
