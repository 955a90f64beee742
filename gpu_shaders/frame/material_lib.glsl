/* The material of a place: the same all over. Programs of node graphs have a generated file in the place of this one. */
#include "frame/surface_lib.glsl"

/* The surface as it looks on average from all sides; surface_toward() tells what it does from one. */
Surface material_evaluate(inout MaterialPlace place)
{
  Material material = material_fetch(material_tx, MATERIAL_INDEX);
  Surface surface;
  vec3 base = material.base_color;
  surface.diffuse = base * (1.0 - material.metallic);
  surface.specular = mix(material.specular, base, material.metallic);
  surface.layer = material.specular * material.layered;
  surface.roughness = material.roughness;
  surface.emission = material.emission;
  surface.transparent = vec3(0.0);
  surface.transmission = vec3(0.0);
  return surface_toward(surface, BXDF_MEAN_COSINE);
}
