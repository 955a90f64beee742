/* What one surface receives from a virtual point light. */
#include "lib/math_lib.glsl"
#include "vpl/vpl_lib.glsl"

/* Both cosines over the squared distance, 1/m². d^2 + A / pi in place of d^2 is exact on the axis of a disc of the
 * light's own area A: what touches it stays bounded. vpl_frame.bound is 1, or 0 to see what that takes away. */
float vpl_form(vec3 position, float area, vec3 normal, vec3 P, vec3 N)
{
  vec3 d = position - P;
  float squared = dot(d, d);
  float cosines = max(dot(N, d), 0.0) * max(-dot(normal, d), 0.0);
  return cosines / max(squared * (squared + vpl_frame.bound * area * (1.0 / MATH_PI)), 1e-30);
}

/* Irradiance / pi, unoccluded. */
vec3 vpl_light(Vpl vpl, vec3 P, vec3 N)
{
  return vpl.flux * (vpl_form(vpl.position, vpl.area, vpl.normal, P, N) * (1.0 / (MATH_PI * MATH_PI)));
}
