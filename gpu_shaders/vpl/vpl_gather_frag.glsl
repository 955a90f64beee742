/* One sample of a pixel's light from the pool: candidates, the choice of one, and a ray to it. */
#include "vpl/vpl_candidates_lib.glsl"
#include "vpl/vpl_surface_lib.glsl"

void main()
{
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * pc_stride + pc_offset, textureSize(position_tx, 0) - 1);
  out_surface = vec4(0.0);
  out_indirect = vec4(0.0);
  out_direct = vec4(0.0);
#if defined(REUSE) && defined(FIRST_HAND)
  out_emitted = vec4(0.0);
#endif
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w <= 0.0) {
    return;
  }
  vec3 P = position.xyz;
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  vec3 origin = voxel_start_seen(P, geometric, math_toward(P, vpl_frame.eye));
  bool visible;
  vec3 carried;
  vec3 from_sky;
  vec3 emitted;
  int has = int(position.w);
  int kinds = (has & HAS_SKY) != 0 ? vpl_frame.kinds & ~(1 << SOURCE_SKY) : vpl_frame.kinds;
  Reservoir r = candidates_choose(P, N, geometric, origin, pixel, 0, kinds, visible, carried, from_sky, emitted);
  carried -= (has & HAS_SKY_BOUNCES) != 0 ? from_sky : vec3(0.0);
  vec3 light = candidates_light(r, visible, P, N, origin);
  out_surface = surface_pack(P, N);
#ifdef BOUND_VIEW
  /* What 1 / d^2 would give more than 1 / (d^2 + A / pi). */
  Vpl vpl = vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, r.id);
  vec3 d = vpl.position - P;
  out_indirect = vec4(light * vpl.area / (MATH_PI * max(dot(d, d), 1e-20)), 1.0);
  return;
#endif
#ifdef REUSE
  bool lit = any(greaterThan(light, vec3(0.0)));
  out_indirect = vec4(intBitsToFloat(r.id), lit ? r.sum / r.target : 0.0, 1.0, 0.0);
  out_direct = vec4(carried + emitted, 1.0);
#ifdef FIRST_HAND
  out_emitted = vec4(emitted, 1.0);
#endif
#else
  int kind = vpl_id_kind(r.id);
  bool first_hand = kind == SOURCE_EMISSION || kind == SOURCE_SKY;
  out_indirect = vec4(carried + (first_hand ? vec3(0.0) : light), 1.0);
  out_direct = vec4(emitted + (first_hand ? light : vec3(0.0)), 1.0);
#endif
}
