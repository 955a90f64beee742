/* The world's radiance from an octahedral map with its pyramid in one picture, n texels high: the map itself, and to its right
 * the levels below it, each above the last (frame/environment_map.py). */
#include "lib/octahedron_lib.glsl"

/* A texel of one level, wherever it lies: beyond an edge the octahedron is folded. */
vec3 environment_texel(sampler2D environment_tx, ivec2 at, int side, ivec2 corner)
{
  if (at.x < 0 || at.x >= side) {
    at = ivec2(at.x < 0 ? -1 - at.x : 2 * side - 1 - at.x, side - 1 - at.y);
  }
  if (at.y < 0 || at.y >= side) {
    at = ivec2(side - 1 - at.x, at.y < 0 ? -1 - at.y : 2 * side - 1 - at.y);
  }
  return texelFetch(environment_tx, corner + clamp(at, ivec2(0), ivec2(side - 1)), 0).rgb;
}

vec3 environment_level(sampler2D environment_tx, vec2 place, int level)
{
  int height = textureSize(environment_tx, 0).y;
  int side = max(height >> level, 1);
  ivec2 corner = level == 0 ? ivec2(0) : ivec2(height, height - 2 * side);
  vec2 texel = place * float(side) - 0.5;
  ivec2 lower = ivec2(floor(texel));
  vec2 part = texel - vec2(lower);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 4; k++) {
    ivec2 aside = ivec2(k & 1, k >> 1);
    vec2 share = mix(1.0 - part, part, vec2(aside));
    sum += share.x * share.y * environment_texel(environment_tx, lower + aside, side, corner);
  }
  return sum;
}

/* Radiance from a unit direction, blurred over about the texels of a level. */
vec3 environment_radiance(sampler2D environment_tx, vec3 direction, float level)
{
  vec2 place = 0.5 + 0.5 * octahedron_encode(direction);
  float most = floor(log2(float(textureSize(environment_tx, 0).y)) + 0.5);
  level = clamp(level, 0.0, most);
  int lower = int(level);
  float part = level - float(lower);
  vec3 sharp = environment_level(environment_tx, place, lower);
  return part > 0.0 ? mix(sharp, environment_level(environment_tx, place, lower + 1), part) : sharp;
}

/* The level whose texels are as large as a solid angle, sr. */
float environment_level_of(sampler2D environment_tx, float omega)
{
  float side = float(textureSize(environment_tx, 0).y);
  return 0.5 * log2(max(omega * side * side * (1.0 / (4.0 * 3.14159265)), 1.0));
}

/* Rays that the first one counts for. */
const float ENVIRONMENT_RAYS = 16.0;

/* The level over which a ray of some density is blurred: what one of the rays so far stands for, which falls with their number
 * (Krivanek & Colbert, "Real-time Shading with Filtered Importance Sampling", 2008). */
float environment_level_of_ray(sampler2D environment_tx, float density, int number)
{
  return environment_level_of(environment_tx, 1.0 / max(ENVIRONMENT_RAYS * float(number + 1) * density, 1e-6));
}
