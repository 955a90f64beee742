/* Rays through the grids of occupied voxels: the sampler voxel_tx and the uniform block voxel_grid, which a shader
 * declares by VOXEL_SAMPLERS and VOXEL_GRID (frame/voxel_shaders.py). Outside all grids nothing blocks. */
#include "frame/voxel_cell_lib.glsl"

/* More than any ray needs, so that an endless loop is none. */
const int VOXEL_MOST_STEPS = 8192;
/* Voxels: the start of a ray is so much further from its surface than the surface's own voxels reach. */
const float VOXEL_ROUNDING = 0.02;
/* Out of another surface's voxels towards who sees the point: so many steps of so many voxels. */
const int VOXEL_ESCAPES = 4;
const float VOXEL_ESCAPE = 0.75;
/* Of an outer grid's voxel: off a plane that lies as far below its layer's end as FLUSH of frame/voxel_grids.py says.
 * It is above the end of the next grid's layer, too. */
const float VOXEL_FLUSH_START = 0.05;
/* Cosine: a plane along an axis has one layer of voxels however wide it is. */
const float VOXEL_ALONG_AXIS = 0.99999;

/* Bits of a texel that a ray may still meet from a cell on, itself included; forward is 1 or 0 along each axis. */
uint voxel_ahead(ivec3 cell, ivec3 forward)
{
  ivec3 at = cell & ivec3(3, 3, 1);
  uint x = 0x11111111u * (forward.x != 0 ? 15u << at.x & 15u : 15u >> (3 - at.x));
  uint y = forward.y != 0 ? 0xffffu << (4 * at.y) & 0xffffu : 0xffffu >> (12 - 4 * at.y);
  uint z = forward.z != 0 ? 0xffffffffu << (16 * at.z) : 0xffffffffu >> (16 - 16 * at.z);
  return x & (y | y << 16) & z;
}

/* By how many bits to widen an empty cell: all of its texel where nothing is ahead in it, two cells each way where those
 * are empty. One texel tells either. */
ivec3 voxel_widening(uint texel, ivec3 cell, ivec3 forward)
{
  if ((texel & voxel_ahead(cell, forward)) == 0u) {
    return ivec3(2, 2, 1);
  }
  bool pairs_empty = (texel >> ((cell.x & 2) | (cell.y & 2) << 2) & 0x00330033u) == 0u;
  return ivec3(int(pairs_empty));
}

/* Where a ray first enters an occupied voxel of one grid between `way` and `reach`: metres along it from its origin, or
 * negative. If it starts in the grid, `way` is then how far the ray is known. */
float voxel_trace_grid(VoxelPlace place, vec3 origin, vec3 slope, vec3 inverse, float reach, inout float way)
{
  vec3 start = (origin - place.origin) / place.edge;
  vec3 one = (vec3(0.0) - start) * inverse;
  vec3 other = (place.size - start) * inverse;
  vec3 enter = min(one, other);
  vec3 leave = max(one, other);
  float first = max(enter.x, max(enter.y, enter.z));
  float t = max(first, way / place.edge);
  float last = min(min(leave.x, leave.y), min(leave.z, reach / place.edge));
  if (!(t < last)) {
    return -1.0;
  }
  float met = -1.0;
  ivec3 forward = ivec3(greaterThan(slope, vec3(0.0)));
  ivec3 highest = ivec3(place.size) - 1;
  ivec3 voxel = clamp(ivec3(floor(start + t * slope)), ivec3(0), highest);
  int level = 0;
  for (int rounds = 0; rounds < VOXEL_MOST_STEPS; rounds++) {
    ivec3 cell = voxel >> (2 * level);
    uint texel = texelFetch(voxel_tx, voxel_texel(place, cell, level), 0).x;
    if ((texel >> voxel_bit(cell) & 1u) != 0u) {
      if (level == 0) {
        met = t * place.edge;
        break;
      }
      level--;
      continue;
    }
    /* Cross the empty cells. The voxel entered is exact along the axis crossed, and stays in their range along the
     * others, so no voxel on the way is left out whatever the rounding of t. */
    ivec3 shift = voxel_widening(texel, cell, forward) + 2 * level;
    ivec3 low = voxel >> shift << shift;
    ivec3 high = min(low + ((ivec3(1) << shift) - 1), highest);
    vec3 ends = (vec3(low + (forward << shift)) - start) * inverse;
    t = min(ends.x, min(ends.y, ends.z));
    if (!(t < last)) { /* the grid's own end as well: it is computed alike. Nor may a t that is no number go on */
      break;
    }
    ivec3 inside = clamp(ivec3(floor(start + t * slope)), low, high);
    bool by_x = ends.x == t;
    bool by_y = !by_x && ends.y == t;
    bool by_z = !by_x && !by_y;
    voxel.x = by_x ? (forward.x != 0 ? high.x + 1 : low.x - 1) : inside.x;
    voxel.y = by_y ? (forward.y != 0 ? high.y + 1 : low.y - 1) : inside.y;
    voxel.z = by_z ? (forward.z != 0 ? high.z + 1 : low.z - 1) : inside.z;
    bool left_parent = voxel >> (2 * level + 2) != low >> (2 * level + 2);
    level += int(left_parent && level < VOXEL_LEVELS - 1);
  }
  way = first > 0.0 ? way : met >= 0.0 ? met : last * place.edge;
  return met;
}

/* Where a ray along a unit direction first enters an occupied voxel: metres, 0 if it starts in one, negative if it
 * meets none before `reach`. An outer grid has nothing inside the one before it: where a ray has left a grid it goes on
 * in the next, and what it meets of several grids that it starts outside of is the nearest. */
float voxel_trace(vec3 origin, vec3 direction, float reach)
{
  /* No component is 0: its inverse times a distance of 0 would be nothing at all. */
  vec3 slope = mix(direction, vec3(1e-9), lessThan(abs(direction), vec3(1e-9)));
  vec3 inverse = 1.0 / slope;
  float way = 0.0;
  float met = -1.0;
  int outer = voxel_grid.outer_count;
  int grid = 0;
  do {
    float found = voxel_trace_grid(voxel_place(grid), origin, slope, inverse, reach, way);
    met = found >= 0.0 ? found : met;
    reach = found >= 0.0 ? found : reach;
    grid++;
  } while (grid <= outer && way < reach);
  return met;
}

/* Whether nothing lies on the way from one point to another. */
bool voxel_clear(vec3 start, vec3 end)
{
  float reach = distance(start, end);
  return reach <= 0.0 || voxel_trace(start, (end - start) / reach, reach) < 0.0;
}

/* The finest grid that holds P, or the widest. */
VoxelPlace voxel_place_at(vec3 P)
{
  /* Lavapipe crashes where a block or texture is first read in a loop that only some pixels of a group go through. */
  int outer = voxel_grid.outer_count;
  int grid = 0;
  while (grid < outer && !voxel_place_holds(voxel_place(grid), P)) {
    grid++;
  }
  return voxel_place(grid);
}

/* Metres of one voxel where P lies. */
float voxel_edge_at(vec3 P)
{
  return voxel_place_at(P).edge;
}

/* Whether something is in the voxel of a grid that a point lies in; false outside it. */
bool voxel_occupied(VoxelPlace place, vec3 P)
{
  ivec3 voxel = ivec3(floor((P - place.origin) / place.edge));
  if (any(lessThan(voxel, ivec3(0))) || any(greaterThanEqual(voxel, ivec3(place.size)))) {
    return false;
  }
  return (texelFetch(voxel_tx, voxel_texel(place, voxel, 0), 0).x >> voxel_bit(voxel) & 1u) != 0u;
}

/* Voxels along its normal to where a plane's own ones end. An occupied voxel's centre is no more than half an edge
 * from the plane along some axis, and its corners reach half a diagonal's share further. */
float voxel_clearance(vec3 unit_normal)
{
  vec3 n = abs(unit_normal);
  return 0.5 * (max(n.x, max(n.y, n.z)) + n.x + n.y + n.z) + VOXEL_ROUNDING;
}

/* Where a ray from a surface may start without meeting the surface's own voxels, on the side that its unit normal
 * points to: 1.0 (along an axis) to 1.2 edges off it. Beside a corner that is in the other surface's voxels. Outside
 * the finest grid a plane along an axis is left as closely as in it where the layer of its voxels ends with it. */
vec3 voxel_start_in(VoxelPlace place, vec3 P, vec3 geometric_normal)
{
  float clearance = voxel_clearance(geometric_normal);
  vec3 start = P + clearance * place.edge * geometric_normal;
  vec3 n = abs(geometric_normal);
  if (place.edge > voxel_grid.edge && max(n.x, max(n.y, n.z)) > VOXEL_ALONG_AXIS) {
    vec3 close = P + max(clearance * voxel_grid.edge, VOXEL_FLUSH_START * place.edge) * geometric_normal;
    return voxel_occupied(place, close) ? start : close;
  }
  return start;
}

vec3 voxel_start(vec3 P, vec3 geometric_normal)
{
  return voxel_start_in(voxel_place_at(P), P, geometric_normal);
}

/* The same for a point known to be seen from the unit direction `seen_from` (the camera's; the light's, for a point of
 * its map): beside a corner it moves that way out of the other surface's voxels, which tell nothing of their two sides. */
vec3 voxel_start_seen(vec3 P, vec3 geometric_normal, vec3 seen_from)
{
  VoxelPlace place = voxel_place_at(P);
  vec3 start = voxel_start_in(place, P, geometric_normal);
  vec3 step = VOXEL_ESCAPE * place.edge * seen_from;
  int steps = 0;
  vec3 moved;
  bool occupied;
  do {
    moved = start + float(steps) * step;
    occupied = voxel_occupied(place, moved);
    steps++;
  } while (occupied && steps <= VOXEL_ESCAPES);
  return occupied ? start : moved;
}
