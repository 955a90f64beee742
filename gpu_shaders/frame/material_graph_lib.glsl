/* What a generated material function gives, as the frame lights it. */
#include "frame/surface_lib.glsl"

/* A normal map may turn the normal from the viewer: it is bent back to graze what it sees. */
const float MATERIAL_GRAZING = 0.01;

/* What a graph makes of huge or impossible numbers would blacken every pixel that its light reaches. */
const float MATERIAL_MOST = 1e20;

vec3 material_finite(vec3 value)
{
  return vec3(isnan(value.x) ? 0.0 : clamp(value.x, -MATERIAL_MOST, MATERIAL_MOST),
              isnan(value.y) ? 0.0 : clamp(value.y, -MATERIAL_MOST, MATERIAL_MOST),
              isnan(value.z) ? 0.0 : clamp(value.z, -MATERIAL_MOST, MATERIAL_MOST));
}

Surface material_surface_of(MaterialSurface given, inout MaterialPlace place)
{
  Surface surface;
  float lobe = surface_mean(given.specular);
  /* A reflectance above 1 would make energy: the one limit put on a material. */
  surface.diffuse = clamp(given.diffuse, vec3(0.0), vec3(1.0));
  surface.specular = clamp(given.specular + given.coat, vec3(0.0), vec3(1.0));
  surface.layer = clamp(given.layer + given.coat, vec3(0.0), vec3(1.0));
  surface.roughness =
      given.coat > 0.0 ? mix(given.roughness, given.coat_roughness, given.coat / (given.coat + lobe)) : given.roughness;
  surface.emission = material_finite(given.emission);
  surface.transparent = max(given.transparent, vec3(0.0));
  surface.transmission = max(given.transmission, vec3(0.0));
  float cosine = dot(given.normal, place.toward);
  place.normal =
      cosine >= MATERIAL_GRAZING ? given.normal : normalize(given.normal + (MATERIAL_GRAZING - cosine) * place.toward);
  return surface_toward(surface, BXDF_MEAN_COSINE);
}
