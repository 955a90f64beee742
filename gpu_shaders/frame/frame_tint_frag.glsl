/* What lies in front of the surface that a pixel shows let it through in this sample: its colour stays. As often as a
 * surface is passed, its mean is counted already. */
#include "frame/material_mesh_lib.glsl"
#include "lib/math_lib.glsl"

void main()
{
  vec3 V = math_toward(v_position, pc_eye);
  MaterialPlace place = material_place(V);
  Surface surface = material_seen(place);
#ifdef MATERIAL_CULLS
  if (place.backfacing > 0.5) {
    discard;
  }
#endif
  float mean = (surface.passing.r + surface.passing.g + surface.passing.b) / 3.0;
  vec4 tint = vec4(mean > 0.0 ? surface.passing / mean : vec3(1.0), 1.0);
  out_albedo = tint;
  out_emission = tint;
  out_specular = tint;
  float straight = (surface.transparent.r + surface.transparent.g + surface.transparent.b) / 3.0;
  out_passed = vec4(tint.rgb, mean > 0.0 ? clamp(straight / mean, 0.0, 1.0) : 1.0);
}
