/* One point of a surface, placed in the world by its instance's matrix. */
#include "frame/material_lib.glsl"
#include "lib/instance_lib.glsl"
#include "lib/math_lib.glsl"

void main()
{
  SurfacePoint point = surface_point_fetch(point_tx, v_point);
  mat4 world_from_object = instance_fetch(instance_tx, point.instance).world_from_object;
  vec3 geometric = instance_normal(world_from_object, point.geometric_normal);
  float size = length(geometric);
  geometric = size > 0.0 ? geometric / size : vec3(0.0, 0.0, 1.0);
  MaterialPlace place;
  place.position = (world_from_object * vec4(point.position, 1.0)).xyz;
  place.geometric = geometric;
  place.normal = surface_shading_normal(instance_normal(world_from_object, point.normal), geometric);
  place.toward = geometric;
  place.object_position = point.position;
  place.instance = point.instance;
  place.backfacing = point.backfacing;
  Surface surface = material_evaluate(place);

  out_position_area = vec4(place.position, point.area);
  if (pc_emits != 0) {
    /* What leaves a surface does so by its true cosine, whatever its shading. */
    out_normal = vec4(geometric, float(SOURCE_EMISSION));
    out_flux = vec4(MATH_PI * point.area * max(surface.emission, vec3(0.0)), 1.0);
    out_reflectance = vec4(0.0);
  } else {
    out_normal = vec4(place.normal, float(SOURCE_CACHE));
    out_flux = vec4(0.0, 0.0, 0.0, 1.0);
    /* The specular lobe as if it were diffuse: the light that it sends on is right in sum, not in direction. */
    vec3 lobe = bxdf_albedo(surface.specular, surface.roughness, BXDF_MEAN_COSINE);
    out_reflectance = vec4(min(surface.albedo + (surface.specular == vec3(0.0) ? vec3(0.0) : lobe), 1.0), 1.0);
  }
}
