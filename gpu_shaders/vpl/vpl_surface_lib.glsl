/* The surfaces that gather: position, and normal in 24 bits, in one texel. */
#include "lib/octahedron_lib.glsl"

struct Gatherer {
  vec3 P;
  vec3 N;
  bool exists;
};

const float SURFACE_STEPS = 4095.0;

vec4 surface_pack(vec3 P, vec3 N)
{
  vec2 steps = floor((0.5 + 0.5 * octahedron_encode(N)) * SURFACE_STEPS + 0.5);
  return vec4(P, steps.x + (SURFACE_STEPS + 1.0) * steps.y + 1.0);
}

/* An empty texel, all zero, holds no surface. */
Gatherer surface_unpack(vec4 packed_surface)
{
  float both = packed_surface.w - 1.0;
  vec2 steps = vec2(mod(both, SURFACE_STEPS + 1.0), floor(both / (SURFACE_STEPS + 1.0)));
  return Gatherer(packed_surface.xyz, octahedron_decode(2.0 * steps / SURFACE_STEPS - 1.0), packed_surface.w > 0.0);
}

/* How well light of one surface does for another, 0 to 1: by their normals, and by how far the one lies off the other's
 * plane, as a part of the distance between them. */
float surface_alike(Gatherer a, Gatherer b)
{
  vec3 apart = b.P - a.P;
  float off = abs(dot(apart, a.N));
  float level = exp2(-16.0 * off * inversesqrt(max(dot(apart, apart), 1e-20)));
  float facing = max(dot(a.N, b.N), 0.0);
  facing *= facing;
  facing *= facing;
  return level * facing * facing;
}
