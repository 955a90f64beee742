/* Deterministic noise: every number depends on pixel, sample and dimension only, so that one input gives one picture.
 * Hash: pcg3d of Jarzynski & Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020. */
#include "lib/math_lib.glsl"

/* The R2 sequence (Roberts 2018): 1/g and 1/g^2 with g the plastic number, in parts of 2^32. */
const uvec2 SAMPLING_R2 = uvec2(3242174889u, 2447445414u);

uvec3 sampling_pcg3d(uvec3 v)
{
  v = v * 1664525u + 1013904223u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return v;
}

/* Two numbers in [0, 1) of one pixel; `seed` tells apart samples and uses. */
vec2 sampling_hash(ivec2 pixel, int seed)
{
  uvec3 bits = sampling_pcg3d(uvec3(uint(pixel.x), uint(pixel.y), uint(seed)));
  return vec2(bits.xy >> 8u) * (1.0 / 16777216.0);
}

/* Point `index` of the R2 sequence, shifted by a random offset in [0, 1) (Cranley-Patterson rotation). Integers keep it
 * exact however far it runs. */
vec2 sampling_r2(int index, vec2 offset)
{
  return fract(offset + vec2((SAMPLING_R2 * uint(index)) >> 8u) * (1.0 / 16777216.0));
}

/* Point `index` of `count` of a Vogel spiral in the unit disc: equal areas, turned by `turn` in [0, 1). */
vec2 sampling_vogel_disc(int index, int count, float turn)
{
  float radius = sqrt((float(index) + 0.5) / float(count));
  float angle = float(index) * 2.39996322972865 + turn * 2.0 * MATH_PI;
  return radius * vec2(cos(angle), sin(angle));
}
