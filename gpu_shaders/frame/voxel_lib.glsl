/* Rays through the grid of occupied voxels: the sampler voxel_tx and the uniform block voxel_grid, which a shader
 * declares by VOXEL_SAMPLERS and VOXEL_GRID (frame/voxel_shaders.py). Outside the grid nothing blocks. */
#include "frame/voxel_cell_lib.glsl"

/* More than any ray needs, so that an endless loop is none. */
const int VOXEL_MOST_STEPS = 8192;
/* Voxels: the start of a ray is so much further from its surface than the surface's own voxels reach. */
const float VOXEL_ROUNDING = 0.02;
/* Voxels: nothing can be told of what lies between points this near. */
const float VOXEL_NEAREST = 2.0;

bool voxel_is_set(ivec3 cell, int level)
{
  return (texelFetch(voxel_tx, voxel_texel(cell, level), 0).x >> voxel_bit(cell) & 1u) != 0u;
}

/* Where a ray along a unit direction first enters an occupied voxel: metres, 0 if it starts in one, negative if it
 * meets none before `reach`. */
float voxel_trace(vec3 origin, vec3 direction, float reach)
{
  vec3 start = (origin - voxel_grid.origin) / voxel_grid.edge;
  /* No component is 0: its inverse times a distance of 0 would be nothing at all. */
  vec3 slope = mix(direction, vec3(1e-9), lessThan(abs(direction), vec3(1e-9)));
  vec3 inverse = 1.0 / slope;
  vec3 one = -start * inverse;
  vec3 other = (voxel_grid.size - start) * inverse;
  vec3 enter = min(one, other);
  vec3 leave = max(one, other);
  float t = max(max(enter.x, enter.y), max(enter.z, 0.0));
  float last = min(min(leave.x, leave.y), min(leave.z, reach / voxel_grid.edge));
  if (!(t < last)) {
    return -1.0;
  }
  ivec3 upward = ivec3(greaterThan(slope, vec3(0.0)));
  ivec3 onward = 2 * upward - 1;
  ivec3 size = ivec3(voxel_grid.size);
  ivec3 voxel = clamp(ivec3(floor(start + t * slope)), ivec3(0), size - 1);
  int level = VOXEL_LEVELS - 1;
  for (int step = 0; step < VOXEL_MOST_STEPS; step++) {
    int shift = 2 * level;
    ivec3 cell = voxel >> shift;
    if (voxel_is_set(cell, level)) {
      if (level == 0) {
        return t * voxel_grid.edge;
      }
      level--;
      continue;
    }
    /* Cross the empty cell. The voxel entered is exact along the axis crossed, and stays in the cell's range along the
     * others, so no voxel on the way is left out whatever the rounding of t. */
    ivec3 low = cell << shift;
    ivec3 high = low + ((1 << shift) - 1);
    vec3 ends = (vec3(low + (upward << shift)) - start) * inverse;
    t = min(ends.x, min(ends.y, ends.z));
    if (t >= last) {
      return -1.0;
    }
    ivec3 crossed = ends.x == t ? ivec3(1, 0, 0) : ends.y == t ? ivec3(0, 1, 0) : ivec3(0, 0, 1);
    ivec3 within = clamp(ivec3(floor(start + t * slope)), low, high);
    ivec3 beyond = low + upward * (high - low) + onward;
    voxel = within + crossed * (beyond - within);
    if (any(lessThan(voxel, ivec3(0))) || any(greaterThanEqual(voxel, size))) {
      return -1.0;
    }
    level += int(level < VOXEL_LEVELS - 1 && voxel >> (shift + 2) != low >> (shift + 2));
  }
  return -1.0;
}

/* Whether something is in the voxel that a point lies in; false outside the grid. */
bool voxel_occupied(vec3 P)
{
  ivec3 voxel = ivec3(floor((P - voxel_grid.origin) / voxel_grid.edge));
  bool inside = all(greaterThanEqual(voxel, ivec3(0))) && all(lessThan(voxel, ivec3(voxel_grid.size)));
  return inside && voxel_is_set(voxel, 0);
}

/* Metres along its normal to where a plane's own voxels end. An occupied voxel's centre is no more than half an edge
 * from the plane along some axis, and its corners reach half a diagonal's share further. */
float voxel_clearance(vec3 unit_normal)
{
  vec3 n = abs(unit_normal);
  return (0.5 * (max(n.x, max(n.y, n.z)) + n.x + n.y + n.z) + VOXEL_ROUNDING) * voxel_grid.edge;
}

/* Where a ray from a surface may start without meeting the surface's own voxels, on the side that its unit normal
 * points to: 1.0 (along an axis) to 1.2 edges off it. */
vec3 voxel_start(vec3 P, vec3 geometric_normal)
{
  return P + voxel_clearance(geometric_normal) * geometric_normal;
}

/* Whether nothing lies between two surface points whose unit normals point to the side that is asked about. Points
 * nearer than the grid can tell see each other. */
bool voxel_visible(vec3 P, vec3 P_geometric, vec3 Q, vec3 Q_geometric)
{
  vec3 start = voxel_start(P, P_geometric);
  vec3 along = voxel_start(Q, Q_geometric) - start;
  float reach = length(along);
  if (distance(P, Q) < VOXEL_NEAREST * voxel_grid.edge || reach == 0.0) {
    return true;
  }
  return voxel_trace(start, along / reach, reach) < 0.0;
}
