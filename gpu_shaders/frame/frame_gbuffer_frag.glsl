#include "frame/surface_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

void main()
{
  vec3 V = math_toward(v_position, pc_eye);
  vec3 geometric = surface_geometric_normal(v_position, V);
  vec3 normal = surface_shading_normal(v_normal, geometric);
  out_position = vec4(v_position, pc_no_indirect != 0 ? -1.0 : 1.0);
  out_normal = vec4(octahedron_encode(normal), octahedron_encode(geometric));
  if (pc_holdout != 0) {
    out_albedo = vec4(0.0, 0.0, 0.0, -1.0);
    out_emission = vec4(0.0);
    out_specular = vec4(0.0);
    return;
  }
  Surface surface =
      surface_evaluate(material_fetch(material_tx, pc_material), base_tx, emission_tx, v_base_uv, v_emission_uv);
  surface = surface_toward(surface, dot(normal, V));
  out_albedo = vec4(surface.albedo, 1.0);
  out_emission = vec4(surface.emission, 1.0);
  out_specular = vec4(surface.specular, surface.roughness);
}
