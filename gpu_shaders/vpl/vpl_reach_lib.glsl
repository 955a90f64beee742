/* Whether light reaches a surface: a ray through the voxels, and for contacts that they are too coarse for a short one over
 * the screen. Needs position_tx, the G-buffer's, and vpl_frame beside what voxel_lib.glsl needs. */
#include "frame/voxel_lib.glsl"
#include "lib/math_lib.glsl"
#include "vpl/vpl_lib.glsl"

/* Voxels: nothing can be told of what lies between points this near. */
const float REACH_NEAREST = 2.0;
/* The ray over the screen: its length and the thickness of what blocks it, both in voxels; its steps. */
const float REACH_CONTACT = 4.0;
const float REACH_THICKNESS = 2.0;
const int REACH_STEPS = 6;
/* Voxels by which a surface must lie before the ray: less is the rounding of a picture's pixels. */
const float REACH_BEFORE = 0.25;

vec2 reach_place(vec4 clip)
{
  return 0.5 + 0.5 * clip.xy / clip.w;
}

/* Whether no surface that the camera sees lies just before the first part of the way to Q. Where a picture's pixels are
 * coarser than the ray's steps they tell nothing. */
bool reach_contact(vec3 P, vec3 Q)
{
  vec2 size = vec2(textureSize(position_tx, 0));
  float reach = distance(P, Q);
  float span = min(REACH_CONTACT * voxel_grid.edge, reach - REACH_THICKNESS * voxel_grid.edge);
  vec3 direction = (Q - P) / reach;
  vec4 first = vpl_frame.clip_from_world * vec4(P, 1.0);
  vec4 last = first + vpl_frame.clip_from_world * vec4(span * direction, 0.0);
  if (span <= 0.0 || last.w <= 0.0 ||
      distance(reach_place(first) * size, reach_place(last) * size) < float(REACH_STEPS)) {
    return true;
  }
  int i = 0;
  bool free = true;
  bool inside = true;
  do {
    float part = (float(i) + 0.5) / float(REACH_STEPS);
    vec3 p = P + direction * (span * part);
    vec2 place = reach_place(mix(first, last, part));
    inside = all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(1.0)));
    vec4 seen = texelFetch(position_tx, clamp(ivec2(place * size), ivec2(0), ivec2(size) - 1), 0);
    float before = math_depth(p, vpl_frame.eye) - math_depth(seen.xyz, vpl_frame.eye);
    free = !inside || seen.w == 0.0 || before <= REACH_BEFORE * voxel_grid.edge ||
           before >= REACH_THICKNESS * voxel_grid.edge;
    i++;
  } while (i < REACH_STEPS && free && inside);
  return free;
}

/* Whether a surface at P, whose rays begin at `start` (voxel_start_seen), sees the light. */
bool reach_sees(vec3 P, vec3 start, Vpl vpl)
{
  if (vpl_frame.occluded == 0 || distance(P, vpl.position) < REACH_NEAREST * voxel_grid.edge) {
    return true;
  }
  return voxel_clear(start, voxel_start(vpl.position, vpl.normal)) &&
         (vpl_frame.contact == 0 || reach_contact(P, vpl.position));
}
