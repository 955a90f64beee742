/* Where the volume holds a cell of a level of the grid; needs the uniform block voxel_grid (frame/voxel_shaders.py).
 *
 * Cells are 1, 4, 16 voxels wide, by level. A texel has 4 x 4 x 2 of them. */

const int VOXEL_LEVELS = 3;

ivec3 voxel_texel(ivec3 cell, int level)
{
  int first = level == 0 ? 0 : level == 1 ? voxel_grid.slice_1 : voxel_grid.slice_2;
  return ivec3((cell.x >> 2) * 2 + ((cell.z >> 1) & 1), cell.y >> 2, (cell.z >> 2) + first);
}

int voxel_bit(ivec3 cell)
{
  return (cell.x & 3) | ((cell.y & 3) << 2) | ((cell.z & 1) << 4);
}
