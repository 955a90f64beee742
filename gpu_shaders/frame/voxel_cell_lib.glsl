/* Where the grids lie, and where the volume holds a cell of a level of one; needs the uniform block voxel_grid
 * (frame/voxel_shaders.py).
 *
 * Cells are 1, 4, 16 voxels wide, by level. A texel has 4 x 4 x 2 of them. */

const int VOXEL_LEVELS = 3;

struct VoxelPlace {
  vec3 origin; /* lower corner, world */
  float edge;  /* metres of one voxel */
  vec3 size;   /* voxels along each axis */
  ivec3 first; /* slice of the volume, by level */
};

/* The grid around the scene is 0, and further ones are around it. */
VoxelPlace voxel_place(int grid)
{
  if (grid == 0) {
    return VoxelPlace(voxel_grid.origin, voxel_grid.edge, voxel_grid.size,
                      ivec3(0, voxel_grid.slice_1, voxel_grid.slice_2));
  }
  vec4 place = grid == 1   ? voxel_grid.place_1
               : grid == 2 ? voxel_grid.place_2
               : grid == 3 ? voxel_grid.place_3
               : grid == 4 ? voxel_grid.place_4
                           : voxel_grid.place_5;
  vec4 size = grid == 1   ? voxel_grid.size_1
              : grid == 2 ? voxel_grid.size_2
              : grid == 3 ? voxel_grid.size_3
              : grid == 4 ? voxel_grid.size_4
                          : voxel_grid.size_5;
  int first = int(size.w);
  int second = first + (int(size.z) + 3) / 4;
  return VoxelPlace(place.xyz, place.w, size.xyz, ivec3(first, second, second + (int(size.z) + 15) / 16));
}

bool voxel_place_holds(VoxelPlace place, vec3 P)
{
  vec3 at = (P - place.origin) / place.edge;
  return all(greaterThanEqual(at, vec3(0.0))) && all(lessThan(at, place.size));
}

ivec3 voxel_texel(VoxelPlace place, ivec3 cell, int level)
{
  int first = level == 0 ? place.first.x : level == 1 ? place.first.y : place.first.z;
  return ivec3((cell.x >> 2) * 2 + ((cell.z >> 1) & 1), cell.y >> 2, (cell.z >> 2) + first);
}

int voxel_bit(ivec3 cell)
{
  return (cell.x & 3) | ((cell.y & 3) << 2) | ((cell.z & 1) << 4);
}
