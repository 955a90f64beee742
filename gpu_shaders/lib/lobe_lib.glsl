/* A specular lobe's roughness and the direction that its light comes from, in the 24 bits that a float holds exactly. */
#include "lib/octahedron_lib.glsl"

const float LOBE_ROUGHNESS = 63.0;
const float LOBE_DIRECTION = 511.0;

float lobe_pack(float roughness, vec3 to_light)
{
  vec2 steps = floor((0.5 + 0.5 * octahedron_encode(to_light)) * LOBE_DIRECTION + 0.5);
  float rough = floor(clamp(roughness, 0.0, 1.0) * LOBE_ROUGHNESS + 0.5);
  return rough + (LOBE_ROUGHNESS + 1.0) * (steps.x + (LOBE_DIRECTION + 1.0) * steps.y);
}

float lobe_roughness(float lobe)
{
  return mod(lobe, LOBE_ROUGHNESS + 1.0) / LOBE_ROUGHNESS;
}

vec3 lobe_direction(float lobe)
{
  float both = floor(lobe / (LOBE_ROUGHNESS + 1.0));
  vec2 steps = vec2(mod(both, LOBE_DIRECTION + 1.0), floor(both / (LOBE_DIRECTION + 1.0)));
  return octahedron_decode(2.0 * steps / LOBE_DIRECTION - 1.0);
}
