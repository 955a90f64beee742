/* Shadow maps without bias: a texel holds depth and the slope of its plane. The receiver is in shadow only when both
 * hold: the texel's plane, continued to the receiver's place, lies before the receiver; and the texel itself lies
 * before the receiver's plane continued to the texel's place. A point of one plane passes both tests as lit; the facets
 * of a convex body pass the second, the walls of a concave corner pass the first. */
#include "frame/map_lib.glsl"
#include "lib/sampling_lib.glsl"

const int SHADOW_TAPS = 16;
/* PCSS looks for blockers up to this many times nearer to the light than the receiver. */
const float SHADOW_BLOCKER_RATIO = 4.0;
/* and never over more than this part of the tile, which bounds its cost and noise. */
const float SHADOW_WIDEST_SEARCH = 0.15;

struct Receiver {
  vec3 p; /* position and geometric normal in the face's frame */
  vec3 n;
  vec2 uv;
  float closeness;
};

/* What a texel says of the receiver: it lies before it; it is (about) the receiver's own surface; or its centre misses
 * that surface, beyond a silhouette or on the other wall of a concave corner, and tells nothing. */
const int SHADOW_BLOCKED = 1;
const int SHADOW_LIT = 0;
const int SHADOW_MISSED = -1;

struct ShadowTap {
  int state;
  float closeness;
};

ShadowTap shadow_tap(MapFace face, sampler2D depth_tx, sampler2D slope_tx, Receiver receiver, vec2 uv)
{
  vec2 place = clamp(floor(uv * face.tile), vec2(0.0), vec2(face.tile - 1.0));
  ivec2 texel = ivec2(face.origin + place);
  float depth = texelFetch(depth_tx, texel, 0).r;
  if (depth >= 1.0) {
    return ShadowTap(SHADOW_MISSED, 0.0);
  }
  vec2 center = (place + 0.5) / face.tile;
  float closeness = map_closeness(face, depth);
  float tolerance = face.perspective != 0 ? face.epsilon * closeness * closeness : face.epsilon;
  vec2 slope = texelFetch(slope_tx, texel, 0).rg;
  bool before_receiver = closeness + dot(slope, receiver.uv - center) > receiver.closeness + tolerance;
  float plane = map_plane_closeness(face, receiver.p, receiver.n, center);
  if (closeness > plane + tolerance) {
    return ShadowTap(before_receiver ? SHADOW_BLOCKED : SHADOW_MISSED, closeness);
  }
  return ShadowTap(closeness < plane - 4.0 * tolerance ? SHADOW_MISSED : SHADOW_LIT, closeness);
}

Receiver shadow_receiver(MapFace face, vec3 P, vec3 geometric)
{
  Receiver receiver;
  receiver.p = map_position(face, P);
  receiver.n = mat3(face.face_from_world) * geometric;
  receiver.uv = map_uv(face, receiver.p);
  receiver.closeness = face.perspective != 0 ? face.far / receiver.p.z : -receiver.p.z / face.far;
  return receiver;
}

/* Visibility from one map position: one texel's width of softness, from noise over the samples. Where a
 * texel tells nothing (a wall's top edge would be lit from beyond the ceiling that rests on it), the texel on the other
 * side answers for it. */
float shadow_hard(MapFace face, sampler2D depth_tx, sampler2D slope_tx, vec3 P, vec3 geometric, vec2 noise)
{
  Receiver receiver = shadow_receiver(face, P, geometric);
  vec2 aside = (noise - 0.5) / face.tile;
  int state = shadow_tap(face, depth_tx, slope_tx, receiver, receiver.uv + aside).state;
  if (state == SHADOW_MISSED) {
    state = shadow_tap(face, depth_tx, slope_tx, receiver, receiver.uv - aside).state;
  }
  return state == SHADOW_BLOCKED ? 0.0 : 1.0;
}

/* Percentage-closer soft shadows (Fernando 2005): find blockers, take the penumbra's width from their mean depth, filter
 * over it. `radius` is the emitter's radius in metres, for a sun the tangent of half its angle. */
float shadow_soft(MapFace face, sampler2D depth_tx, sampler2D slope_tx, vec3 P, vec3 geometric, float radius,
                  vec2 noise)
{
  Receiver receiver = shadow_receiver(face, P, geometric);
  float per_metre = 0.5 * max(face.scale.x, face.scale.y);
  float z = receiver.p.z;
  float search = per_metre * radius * (face.perspective != 0 ? (SHADOW_BLOCKER_RATIO - 1.0) / z : z);
  search = min(search, SHADOW_WIDEST_SEARCH);
  float blocker = 0.0;
  float blockers = 0.0;
  for (int i = 0; i < SHADOW_TAPS; i++) {
    vec2 uv = receiver.uv + search * sampling_vogel_disc(i, SHADOW_TAPS, noise.x);
    ShadowTap tap = shadow_tap(face, depth_tx, slope_tx, receiver, uv);
    if (tap.state == SHADOW_BLOCKED) {
      blocker += tap.closeness;
      blockers += 1.0;
    }
  }
  if (blockers == 0.0) {
    return 1.0;
  }
  blocker /= blockers;
  float width =
      per_metre * radius *
      (face.perspective != 0 ? (blocker - receiver.closeness) / face.far : (blocker - receiver.closeness) * face.far);
  width = clamp(width, 0.5 / face.tile, SHADOW_WIDEST_SEARCH);
  float lit = 0.0;
  for (int i = 0; i < SHADOW_TAPS; i++) {
    vec2 uv = receiver.uv + width * sampling_vogel_disc(i, SHADOW_TAPS, noise.y);
    lit += shadow_tap(face, depth_tx, slope_tx, receiver, uv).state == SHADOW_BLOCKED ? 0.0 : 1.0;
  }
  return lit / float(SHADOW_TAPS);
}
