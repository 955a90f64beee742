/* What one surface receives from a virtual point light. */
#include "lib/bxdf_lib.glsl"
#include "lib/lobe_lib.glsl"
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

/* pi^2 times the radiant intensity of which vpl_form() has the cosine: the diffuse flux, and the lobe's part toward a
 * unit direction. Lobes narrower than vpl_frame.lobe are widened to it: of a few lights that stand for a mirror hardly
 * any shines on a surface, and that one without end. */
vec3 vpl_flux_toward(vec3 flux, vec4 specular, vec3 normal, vec3 direction)
{
#ifdef GLOSSY
  if (specular.rgb != vec3(0.0)) {
    float roughness = max(lobe_roughness(specular.w), vpl_frame.lobe);
    flux += MATH_PI * specular.rgb * bxdf_specular(normal, lobe_direction(specular.w), direction, vec3(1.0), roughness);
  }
#endif
  return flux;
}

/* Irradiance / pi, unoccluded. */
vec3 vpl_light(Vpl vpl, vec3 P, vec3 N)
{
  vec3 flux = vpl_flux_toward(vpl.flux, vpl.specular, vpl.normal, normalize(P - vpl.position));
  return flux * (vpl_form(vpl.position, vpl.area, vpl.normal, P, N) * (1.0 / (MATH_PI * MATH_PI)));
}

/* Radiance toward a unit direction. */
vec3 vpl_radiance(Vpl vpl, vec3 direction)
{
  return vpl_flux_toward(vpl.flux, vpl.specular, vpl.normal, direction) / max(MATH_PI * vpl.area, 1e-30);
}
