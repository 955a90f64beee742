/* The material at a fragment: what the full node graph will replace. */
#include "lib/bxdf_lib.glsl"
#include "lib/image_lib.glsl"

struct Surface {
  vec3 albedo;   /* diffuse reflectance, 0..1 */
  vec3 specular; /* specular reflectance at normal incidence; black where there is no lobe */
  float roughness;
  vec3 emission; /* radiance, W/(m^2 sr) */
  vec3 diffuse;  /* diffuse reflectance without the layer over it */
  vec3 layer;    /* specular reflectance of that layer at normal incidence */
};

/* The surface seen from a direction of this cosine to the shading normal: the layer takes from the diffuse part what it
 * reflects itself, as Cycles layers them: by its greatest channel. */
Surface surface_toward(Surface surface, float cosine)
{
  vec3 taken = vec3(0.0);
  if (surface.layer != vec3(0.0)) {
    taken = bxdf_albedo(surface.layer, surface.roughness, cosine);
  }
  surface.albedo = surface.diffuse * (1.0 - max(taken.r, max(taken.g, taken.b)));
  return surface;
}

/* As it looks on average from all sides; surface_toward() tells what it does from one. */
Surface surface_evaluate(Material material, sampler2D base_tx, sampler2D emission_tx, vec2 base_uv, vec2 emission_uv)
{
  Surface surface;
  vec3 base = material.base_color;
  if (material.base_mode >= 0) {
    base = image_sample(base_tx, base_uv, material.base_mode).rgb;
  }
  /* A reflectance above 1 would make energy: the one limit put on a material. */
  base = clamp(base, vec3(0.0), vec3(1.0));
  surface.diffuse = base * (1.0 - material.metallic);
  surface.specular = mix(material.specular, base, material.metallic);
  surface.layer = material.specular * material.layered;
  surface.roughness = material.roughness;
  surface.emission = material.emission;
  if (material.emission_mode >= 0) {
    surface.emission *= image_sample(emission_tx, emission_uv, material.emission_mode).rgb;
  }
  return surface_toward(surface, BXDF_MEAN_COSINE);
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
