/* One pass of an edge-avoiding a-trous filter (Dammertz et al. 2010) whose width follows the variance (Schied et al. 2017):
 * where the mean is sure, it is left as it is. Direct light is a part of it, and mixed alike. */
#include "vpl/vpl_strength_lib.glsl"
#include "vpl/vpl_surface_lib.glsl"

/* Neighbours may differ by so many standard deviations of their difference. That is the same for both of a pair: if only the
 * variance of the one that takes counted, single bright texels would lose their light. */
const float ATROUS_DEVIATIONS = 2.0;

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  out_light = texelFetch(light_tx, texel, 0);
#ifdef FIRST_HAND
  out_direct = vec4(0.0);
#endif
  Gatherer at = surface_unpack(texelFetch(surface_tx, texel, 0));
  if (!at.exists) {
    return;
  }
  vec4 own = out_light;
#ifdef FIRST_HAND
  vec3 direct = texelFetch(direct_tx, texel, 0).rgb;
#endif
  float level = vpl_strength(own.rgb);
  ivec2 last = textureSize(light_tx, 0) - 1;
  vec3 sum = own.rgb;
  float variances = own.w;
  float weights = 1.0;
  for (int i = 0; i < 9; i++) {
    ivec2 aside = ivec2(i % 3 - 1, i / 3 - 1);
    ivec2 from = texel + pc_step * aside;
    if (i == 4 || any(lessThan(from, ivec2(0))) || any(greaterThan(from, last))) {
      continue;
    }
    Gatherer other = surface_unpack(texelFetch(surface_tx, from, 0));
    if (!other.exists) {
      continue;
    }
    vec4 light = texelFetch(light_tx, from, 0);
    float weight =
        (aside.x * aside.y == 0 ? 0.5 : 0.25) * surface_alike(at, other) *
        exp(-abs(vpl_strength(light.rgb) - level) / (ATROUS_DEVIATIONS * sqrt(own.w + light.w) + 1e-6 + 1e-3 * level));
    sum += weight * light.rgb;
#ifdef FIRST_HAND
    direct += weight * texelFetch(direct_tx, from, 0).rgb;
#endif
    variances += weight * weight * light.w;
    weights += weight;
  }
  out_light = vec4(sum / weights, variances / (weights * weights));
#ifdef FIRST_HAND
  out_direct = vec4(direct / weights, 0.0);
#endif
}
