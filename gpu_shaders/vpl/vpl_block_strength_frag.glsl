/* Strength of blocks of PYRAMID_STEP x PYRAMID_STEP virtual point lights. */
#include "vpl/vpl_strength_lib.glsl"

void main()
{
  ivec2 first = ivec2(gl_FragCoord.xy) * PYRAMID_STEP;
  float sum = 0.0;
  for (int i = 0; i < PYRAMID_STEP * PYRAMID_STEP; i++) {
    sum += vpl_texel_strength(flux_tx, specular_tx, first + ivec2(i % PYRAMID_STEP, i / PYRAMID_STEP));
  }
  out_sum = vec4(sum);
}
