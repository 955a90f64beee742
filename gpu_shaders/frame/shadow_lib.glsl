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

/* What rounding leaves uncertain, each a few times what it can be: depth as a map holds it (relative in perspective, part
 * of the whole depth in orthographic maps); directions, relative; world positions, relative to their coordinates;
 * slopes, kept as halves. */
const float SHADOW_DEPTH_ROUNDING = 4e-6;
const float SHADOW_DIRECTION_ROUNDING = 5e-7;
const float SHADOW_POSITION_ROUNDING = 4e-7;
const float SHADOW_SLOPE_ROUNDING = 1e-3;

struct Receiver {
  vec3 p; /* position and geometric normal in the face's frame */
  vec3 n;
  vec2 uv;
  float closeness;
  float rounding; /* of its position, metres */
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

/* Rounding of the receiver's own closeness. */
float shadow_receiver_rounding(MapFace face, Receiver receiver)
{
  return receiver.rounding * (face.perspective != 0 ? receiver.closeness / receiver.p.z : 1.0 / face.far);
}

/* Rounding of the closeness of the receiver's plane, `plane`, away from the receiver. */
float shadow_plane_rounding(MapFace face, Receiver receiver, float plane)
{
  float height = SHADOW_DIRECTION_ROUNDING * length(receiver.p) + receiver.rounding;
  return height *
         (face.perspective != 0 ? abs(plane / dot(receiver.n, receiver.p)) : 1.0 / (abs(receiver.n.z) * face.far));
}

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
  float rounding = SHADOW_DEPTH_ROUNDING * (face.perspective != 0 ? closeness : 1.0);
  vec2 slope = texelFetch(slope_tx, texel, 0).rg;
  float along = dot(slope, receiver.uv - center);
  float at_receiver = rounding + SHADOW_SLOPE_ROUNDING * abs(along) + shadow_receiver_rounding(face, receiver);
  bool before_receiver = closeness + along > receiver.closeness + at_receiver;
  float plane = map_plane_closeness(face, receiver.p, receiver.n, center);
  float at_texel = rounding + shadow_plane_rounding(face, receiver, plane);
  if (closeness > plane + at_texel) {
    return ShadowTap(before_receiver ? SHADOW_BLOCKED : SHADOW_MISSED, closeness);
  }
  return ShadowTap(closeness < plane - 4.0 * at_texel ? SHADOW_MISSED : SHADOW_LIT, closeness);
}

Receiver shadow_receiver(MapFace face, vec3 P, vec3 geometric)
{
  Receiver receiver;
  receiver.p = map_position(face, P);
  receiver.n = mat3(face.face_from_world) * geometric;
  receiver.uv = map_uv(face, receiver.p);
  receiver.closeness = face.perspective != 0 ? face.far / receiver.p.z : -receiver.p.z / face.far;
  vec3 size = abs(P);
  receiver.rounding = SHADOW_POSITION_ROUNDING * max(size.x, max(size.y, size.z));
  return receiver;
}

/* Visibility by SHADOW_TAPS texels within `width` where it is `wide`, or by one within a texel's; which, noise tells.
 * Where none of them tells anything (a wall's top edge would be lit from beyond the ceiling that rests on it), the nine
 * around the receiver's own answer for them; lit if they do not. */
float shadow_mean(MapFace face, sampler2D depth_tx, sampler2D slope_tx, Receiver receiver, bool wide, vec2 width,
                  vec2 noise)
{
  int taps = wide ? SHADOW_TAPS : 1;
  float lit = 0.0;
  float telling = 0.0;
  int end = taps;
  int i = 0;
  do {
    int around = i - taps;
    vec2 aside = around >= 0 ? vec2(around % 3 - 1, around / 3 - 1) / face.tile
                 : !wide     ? (noise - 0.5) / face.tile
                             : width * sampling_vogel_disc(i, SHADOW_TAPS, noise.y);
    int state = shadow_tap(face, depth_tx, slope_tx, receiver, receiver.uv + aside).state;
    telling += state == SHADOW_MISSED ? 0.0 : 1.0;
    lit += state == SHADOW_LIT ? 1.0 : 0.0;
    i++;
    end = i == taps && telling == 0.0 ? taps + 9 : end;
  } while (i < end);
  return telling > 0.0 ? lit / telling : 1.0;
}

/* Visibility from one map position: one texel's width of softness, from noise over the samples. */
float shadow_hard(MapFace face, sampler2D depth_tx, sampler2D slope_tx, vec3 P, vec3 geometric, vec2 noise)
{
  Receiver receiver = shadow_receiver(face, P, geometric);
  return shadow_mean(face, depth_tx, slope_tx, receiver, false, vec2(0.0), noise);
}

/* Percentage-closer soft shadows (Fernando 2005): find blockers, take the penumbra's width from their mean depth, filter
 * over it. `radius` is the emitter's along the face's axes, metres; for a sun the tangent of half its angle. */
float shadow_soft(MapFace face, sampler2D depth_tx, sampler2D slope_tx, vec3 P, vec3 geometric, vec2 radius, vec2 noise)
{
  Receiver receiver = shadow_receiver(face, P, geometric);
  vec2 per_metre = 0.5 * face.scale * radius;
  float z = receiver.p.z;
  vec2 search = per_metre * (face.perspective != 0 ? (SHADOW_BLOCKER_RATIO - 1.0) / z : z);
  search = min(search, vec2(SHADOW_WIDEST_SEARCH));
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
  float apart = blocker / max(blockers, 1.0) - receiver.closeness;
  vec2 width = per_metre * (face.perspective != 0 ? apart / face.far : apart * face.far);
  width = clamp(width, vec2(0.5 / face.tile), vec2(SHADOW_WIDEST_SEARCH));
  return shadow_mean(face, depth_tx, slope_tx, receiver, blockers > 0.0, width, noise);
}
