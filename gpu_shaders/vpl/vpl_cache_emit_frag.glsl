/* What a point of the cache reflects of the light that it has gathered: flux in watts, to the atlas. It counts nothing
 * where lights are chosen by strength: rays find it (candidates_carried), which is calmer near it. */
#include "lib/math_lib.glsl"

/* Watts of a point that is lit and reflects nothing: it answers for hits, unlike one inside of things, which has none. */
const vec3 EMIT_LEAST = vec3(1e-30);

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 sum = texelFetch(sum_tx, texel - pc_origin, 0);
  vec3 light = sum.rgb / max(sum.w, 1.0);
  float area = texelFetch(position_area_tx, texel, 0).w;
  vec3 flux = MATH_PI * area * light * texelFetch(reflectance_tx, texel, 0).rgb;
  out_flux = vec4(light == vec3(0.0) ? flux : max(flux, EMIT_LEAST), 0.0);
}
