/* Fractals of Perlin's noise (Musgrave, in Ebert et al., "Texturing and Modeling", chapter 16): the Noise Texture.
 * Each goes over floor(detail) + 1 octaves and blends the next one in by detail's fraction. */
#include "materials/perlin_lib.glsl"

struct NoiseFractal {
  int dimensions;
  float detail; /* octaves beyond the first */
  float roughness;
  float lacunarity;
  float offset;
  float gain;
};

/* Limits that Cycles puts on the sockets. */
NoiseFractal noise_settings(int dimensions, float detail, float roughness, float lacunarity, float offset, float gain)
{
  return NoiseFractal(dimensions, clamp(detail, 0.0, 15.0), max(roughness, 0.0), lacunarity, offset, gain);
}

/* The sum of octaves: x as it is, y brought to 0..1 by the largest value that it can take. */
vec2 noise_octaves(vec4 p, NoiseFractal n)
{
  float sum = 0.0, largest = 0.0, amplitude = 1.0;
  for (int i = 0; i <= int(n.detail); i++) {
    sum += perlin_noise(p, n.dimensions) * amplitude;
    largest += amplitude;
    amplitude *= n.roughness;
    p *= n.lacunarity;
  }
  vec2 whole = vec2(sum, 0.5 * sum / largest + 0.5);
  float rest = fract(n.detail);
  if (rest == 0.0) {
    return whole;
  }
  sum += perlin_noise(p, n.dimensions) * amplitude;
  return mix(whole, vec2(sum, 0.5 * sum / (largest + amplitude) + 0.5), rest);
}

float noise_fbm(vec4 p, NoiseFractal n)
{
  return noise_octaves(p, n).x;
}

float noise_fbm_normalized(vec4 p, NoiseFractal n)
{
  return noise_octaves(p, n).y;
}

float noise_multifractal(vec4 p, NoiseFractal n)
{
  float value = 1.0, power = 1.0;
  for (int i = 0; i <= int(n.detail); i++) {
    value *= power * perlin_noise(p, n.dimensions) + 1.0;
    power *= n.roughness;
    p *= n.lacunarity;
  }
  float rest = fract(n.detail);
  return rest == 0.0 ? value : value * (rest * power * perlin_noise(p, n.dimensions) + 1.0);
}

float noise_hetero_terrain(vec4 p, NoiseFractal n)
{
  float value = n.offset + perlin_noise(p, n.dimensions), power = n.roughness;
  for (int i = 1; i <= int(n.detail); i++) {
    p *= n.lacunarity;
    value += (perlin_noise(p, n.dimensions) + n.offset) * power * value;
    power *= n.roughness;
  }
  float rest = fract(n.detail);
  return rest == 0.0 ? value : value + rest * (perlin_noise(p * n.lacunarity, n.dimensions) + n.offset) * power * value;
}

/* Octaves fade where those before them were low. */
float noise_hybrid_multifractal(vec4 p, NoiseFractal n)
{
  float value = 0.0, power = 1.0, weight = 1.0;
  for (int i = 0; i <= int(n.detail) && weight > 0.001; i++) {
    float signal = (perlin_noise(p, n.dimensions) + n.offset) * power;
    weight = min(weight, 1.0);
    value += weight * signal;
    weight *= n.gain * signal;
    power *= n.roughness;
    p *= n.lacunarity;
  }
  float rest = fract(n.detail);
  if (rest == 0.0 || weight <= 0.001) {
    return value;
  }
  return value + rest * min(weight, 1.0) * (perlin_noise(p, n.dimensions) + n.offset) * power;
}

float noise_ridge(vec4 p, NoiseFractal n)
{
  float ridge = n.offset - abs(perlin_noise(p, n.dimensions));
  return ridge * ridge;
}

/* Whole octaves only. */
float noise_ridged_multifractal(vec4 p, NoiseFractal n)
{
  float signal = noise_ridge(p, n), value = signal, power = n.roughness;
  for (int i = 1; i <= int(n.detail); i++) {
    p *= n.lacunarity;
    signal = noise_ridge(p, n) * clamp(signal * n.gain, 0.0, 1.0);
    value += signal * power;
    power *= n.roughness;
  }
  return value;
}

/* Where the noise of a seed lies: at 100 to 200 along each axis. */
vec4 noise_offset(float seed, int dimensions)
{
  if (dimensions == 1) {
    return vec4(100.0 + 100.0 * hash_float(vec4(seed), 1), 0.0, 0.0, 0.0);
  }
  vec4 offset = vec4(0.0);
  for (int i = 0; i < dimensions; i++) {
    offset[i] = 100.0 + 100.0 * hash_float(vec4(seed, float(i), 0.0, 0.0), 2);
  }
  return offset;
}

/* The place moved by a noise for each axis. */
vec4 noise_distort(vec4 p, float distortion, int dimensions)
{
  vec4 moved = p;
  if (distortion != 0.0) {
    for (int i = 0; i < dimensions; i++) {
      moved[i] += perlin_noise(p + noise_offset(float(i), dimensions), dimensions) * distortion;
    }
  }
  return moved;
}

/* The coordinates that a texture of so many dimensions looks at, the others 0. */
vec4 noise_place(vec3 vector, float w, int dimensions)
{
  return dimensions == 1   ? vec4(w, 0.0, 0.0, 0.0)
         : dimensions == 2 ? vec4(vector.xy, 0.0, 0.0)
         : dimensions == 3 ? vec4(vector, 0.0)
                           : vec4(vector, w);
}
