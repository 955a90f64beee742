/* Improved noise (Perlin 2002) of one to four dimensions, the corners' gradients drawn by lookup3. */
#include "materials/hash_lib.glsl"

/* What brings each dimension's noise to about -1..1, as Cycles scales it. */
const vec4 PERLIN_SCALE = vec4(0.25, 0.6616, 0.982, 0.8344);
/* Coordinates repeat here: beyond it their fractions have too few bits. */
const float PERLIN_PERIOD = 100000.0;

float perlin_fade(float t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

float perlin_signed_by(float value, uint bits)
{
  return bits != 0u ? -value : value;
}

/* The gradient of a corner times the way from it: from 8 or 16 (1D), 8, 12 and 32 directions. */
float perlin_gradient(uint hash, vec4 d, int count)
{
  if (count == 1) {
    uint h = hash & 15u;
    return perlin_signed_by(1.0 + float(h & 7u), h & 8u) * d.x;
  }
  uint h = hash & (count == 2 ? 7u : count == 3 ? 15u : 31u);
  if (count == 2) {
    float u = h < 4u ? d.x : d.y;
    float v = 2.0 * (h < 4u ? d.y : d.x);
    return perlin_signed_by(u, h & 1u) + perlin_signed_by(v, h & 2u);
  }
  if (count == 3) {
    float u = h < 8u ? d.x : d.y;
    float v = h < 4u ? d.y : h == 12u || h == 14u ? d.x : d.z;
    return perlin_signed_by(u, h & 1u) + perlin_signed_by(v, h & 2u);
  }
  float u = h < 24u ? d.x : d.y;
  float v = h < 16u ? d.y : d.z;
  float s = h < 8u ? d.z : d.w;
  return perlin_signed_by(u, h & 1u) + perlin_signed_by(v, h & 2u) + perlin_signed_by(s, h & 4u);
}

/* Noise of about -1..1 of the first `count` coordinates; the others are 0. */
float perlin_noise(vec4 place, int count)
{
  vec4 p = place - PERLIN_PERIOD * trunc(place / PERLIN_PERIOD);
  /* Huge coordinates are whole numbers, where noise is 0. */
  p += 0.5 * vec4(greaterThanEqual(abs(place), vec4(1e6)));
  vec4 cell = floor(p);
  vec4 f = p - cell;
  vec4 t = vec4(perlin_fade(f.x), perlin_fade(f.y), perlin_fade(f.z), perlin_fade(f.w));
  float sum = 0.0;
  for (int k = 0; k < 1 << count; k++) {
    ivec4 corner = ivec4(k & 1, k >> 1 & 1, k >> 2 & 1, k >> 3 & 1);
    uint hash = hash_words(uvec4(ivec4(cell) + corner), count);
    vec4 share = mix(1.0 - t, t, vec4(corner));
    float weight = share.x * (count > 1 ? share.y : 1.0) * (count > 2 ? share.z : 1.0) * (count > 3 ? share.w : 1.0);
    sum += weight * perlin_gradient(hash, f - vec4(corner), count);
  }
  return sum * PERLIN_SCALE[count - 1];
}
