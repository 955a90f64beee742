/* Every texel of every map, in pieces of texel rows: the truth that the disc estimators are tested against. */
#include "rsm/rsm_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy) * pc_stride + pc_offset;
  out_indirect = vec4(0.0);
  RsmReceiver receiver = rsm_receiver(pixel, ivec2(gl_FragCoord.xy), position_tx, normal_tx, reused_tx);
  if (!receiver.gathers) {
    return;
  }
  vec3 sum = vec3(0.0);
  for (int y = pc_first_row; y < pc_last_row; y++) {
    for (int x = 0; x < pc_row_length; x++) {
      sum += rsm_texel_light(ivec2(x, y), rsm_position_tx, rsm_normal_tx, rsm_flux_tx, receiver.P, receiver.N);
    }
  }
  out_indirect = vec4(sum, 1.0);
}
