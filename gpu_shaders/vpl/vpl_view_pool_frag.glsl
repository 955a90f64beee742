#include "lib/math_lib.glsl"

/* Entries behind what the camera sees are faint. */
const float POOL_HIDDEN = 0.15;
const float POOL_BEHIND = 1.02; /* as a part of the distance to what is seen */

void main()
{
  vec4 seen = texelFetch(position_tx, ivec2(gl_FragCoord.xy), 0);
  float there = math_depth(v_position, pc_eye);
  float here = math_depth(seen.xyz, pc_eye);
  float limit = pc_eye.w > 0.5 ? here * POOL_BEHIND : here + (POOL_BEHIND - 1.0) * (abs(here) + 1.0);
  bool hidden = seen.w != 0.0 && there > limit;
  out_color = vec4(v_color * (hidden ? POOL_HIDDEN : 1.0), 0.0);
}
