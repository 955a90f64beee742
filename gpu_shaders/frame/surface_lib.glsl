/* The material at a fragment: what the full node graph will replace. */
#include "lib/image_lib.glsl"

struct Surface {
  vec3 albedo;   /* diffuse reflectance, 0..1 */
  vec3 emission; /* radiance, W/(m^2 sr) */
};

Surface surface_evaluate(Material material, sampler2D base_tx, sampler2D emission_tx, vec2 base_uv, vec2 emission_uv)
{
  Surface surface;
  surface.albedo = material.base_color;
  if (material.base_mode >= 0) {
    surface.albedo = image_sample(base_tx, base_uv, material.base_mode).rgb;
  }
  /* A reflectance above 1 would make energy: the one limit put on a material. */
  surface.albedo = clamp(surface.albedo, vec3(0.0), vec3(1.0));
  surface.emission = material.emission;
  if (material.emission_mode >= 0) {
    surface.emission *= image_sample(emission_tx, emission_uv, material.emission_mode).rgb;
  }
  return surface;
}

/* The unit normal of the triangle itself, on the side of `eye_direction` (from the surface to the viewer). */
vec3 surface_geometric_normal(vec3 P, vec3 eye_direction)
{
  vec3 n = cross(dFdx(P), dFdy(P));
  float size = length(n);
  n = size > 0.0 ? n / size : eye_direction;
  return dot(n, eye_direction) < 0.0 ? -n : n;
}

/* The shading normal on the viewer's side; the geometric one where the mesh's own is degenerate. */
vec3 surface_shading_normal(vec3 normal, vec3 geometric)
{
  float size = length(normal);
  vec3 n = size > 1e-20 ? normal / size : geometric;
  return dot(n, geometric) < 0.0 ? -n : n;
}
