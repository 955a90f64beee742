/* Some rounds of gathering at one point of the cache: irradiance / pi from the pool, and their number. */
#include "vpl/vpl_candidates_lib.glsl"

/* Where the points' noise begins, beyond any picture's pixels. */
const ivec2 CACHE_PIXEL = ivec2(1 << 20, 0);

void main()
{
  ivec2 point = ivec2(gl_FragCoord.xy);
  ivec2 texel = point + pc_origin;
  out_sum = vec4(0.0);
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec3 N = texelFetch(normal_kind_tx, texel, 0).xyz;
  if (place.w == 0.0) {
    return;
  }
  for (int i = 0; i < pc_rounds; i++) {
    bool visible;
    vec3 carried;
    vec3 emitted;
    Reservoir r = candidates_choose(place.xyz, N, N, N, point + CACHE_PIXEL, i, visible, carried, emitted);
    vec3 light = candidates_light(r, visible, place.xyz, N, N, N);
    out_sum += vec4(light + emitted + ((vpl_frame.kinds >> SOURCE_CACHE & 1) != 0 ? carried : vec3(0.0)), 1.0);
  }
}
