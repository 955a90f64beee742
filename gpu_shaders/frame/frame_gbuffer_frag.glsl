#include "frame/material_mesh_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

void main()
{
  vec3 V = math_toward(v_position, pc_eye);
  MaterialPlace place = material_place(V);
  Surface surface = material_drawn(place);
  out_position = vec4(v_position, (v_drawn.w & VISIBILITY_NO_INDIRECT) != 0 ? -1.0 : 1.0);
  out_normal = vec4(octahedron_encode(place.normal), octahedron_encode(place.geometric));
  if ((v_drawn.w & VISIBILITY_HOLDOUT) != 0) {
    out_albedo = vec4(0.0, 0.0, 0.0, -1.0);
    out_emission = vec4(0.0);
    out_specular = vec4(0.0);
    return;
  }
  out_albedo = vec4(surface.albedo, 1.0);
  out_emission = vec4(surface.emission, 1.0);
  out_specular = vec4(surface.specular, surface.roughness);
}
