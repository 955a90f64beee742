/* Every texel of every map, in pieces of texel rows: the truth that the disc estimators are tested against. */
#include "lib/octahedron_lib.glsl"
#include "rsm/rsm_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy) * pc_stride + pc_offset;
  out_indirect = vec4(0.0);
  /* The last pixels of a coarse grid may lie beyond the picture. */
  if (any(greaterThanEqual(pixel, textureSize(position_tx, 0)))) {
    return;
  }
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w == 0.0 || rsm_reused(reused_tx, ivec2(gl_FragCoord.xy))) {
    return;
  }
  vec3 N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  vec3 sum = vec3(0.0);
  for (int y = pc_first_row; y < pc_last_row; y++) {
    for (int x = 0; x < pc_row_length; x++) {
      sum += rsm_texel_irradiance(ivec2(x, y), rsm_position_tx, rsm_normal_tx, rsm_flux_tx, position.xyz, N);
    }
  }
  out_indirect = vec4(sum, 1.0);
}
