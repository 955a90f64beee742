/* Whether a surface that lets light pass stops it in this sample: as often as it would in truth. */
#include "lib/sampling_lib.glsl"

bool material_is_passed(float coverage)
{
  if (coverage >= 1.0) {
    return false;
  }
  /* Surfaces behind one another decide for themselves: the depth's bits are in the seed. */
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int seed = int(uint(floatBitsToInt(gl_FragCoord.z)) ^ (uint(pc_dither) * 2654435761u));
  return sampling_hash(pixel, seed).x >= coverage;
}
