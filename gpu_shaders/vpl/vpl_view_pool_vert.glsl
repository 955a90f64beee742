/* Six corners make one entry of the pool a square on the screen. */
#include "vpl/vpl_lib.glsl"

/* Half a side in pixels of an entry that stands for the mean of them all, and limits of the others'. */
const float POOL_POINT = 2.5;
const float POOL_SMALLEST = 1.0;
const float POOL_LARGEST = 8.0;

void main()
{
  int entry = gl_VertexID / 6;
  int corner = gl_VertexID % 6;
  ivec2 texel = ivec2(entry % VPL_POOL_ROW, entry / VPL_POOL_ROW);
  vec4 position = texelFetch(pool_position_tx, texel, 0);
  vec4 flux = texelFetch(pool_flux_tx, texel, 0);
  vec4 specular = texelFetch(pool_specular_tx, texel, 0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  v_position = position.xyz;
  v_color = vec3(0.0);
  vec3 light = flux.rgb + specular.rgb;
  vec4 clip = pc_clip_from_world * vec4(position.xyz, 1.0);
  /* Unused entries have no probability; behind the camera nothing is drawn. */
  if (flux.w <= 0.0 || clip.w <= 0.0) {
    return;
  }
  float strongest = max(light.r, max(light.g, light.b));
  v_color = light / max(strongest, 1e-30);
  /* The strength of one entry over the mean of all: chosen in proportion to weights, whose sum stands for all light. */
  float total = texelFetch(sums_tx, ivec2(max(pc_tiles - 1, 0), 0), 0).y;
  float share = vpl_strength(light) / max(flux.w * total, 1e-30);
  /* Of what the far sky sends, little arrives: its watts tell nothing. */
  int kind = vpl_id_kind(floatBitsToInt(texelFetch(pool_normal_tx, texel, 0).w));
  share = kind == SOURCE_SKY ? 1.0 : share;
  float half_side = clamp(POOL_POINT * sqrt(share), POOL_SMALLEST, POOL_LARGEST);
  vec2 place = vec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner == 4 || corner == 5);
  clip.xy += (2.0 * place - 1.0) * 2.0 * half_side * pc_pixel * clip.w;
  gl_Position = vec4(clip.xy, 0.0, clip.w);
}
