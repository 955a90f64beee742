/* Shadows of what lets light pass, on the whole or through the backs of faces: of each texel's light as much is stopped,
 * all or nothing, as of the whole. The material is asked from the side of what the shadow falls on, whence Cycles' rays
 * come. */
#include "frame/material_dither_lib.glsl"
#include "frame/material_mesh_lib.glsl"
#include "frame/shadow_slope_lib.glsl"
#include "lib/math_lib.glsl"

void main()
{
  vec3 toward = -math_toward(v_position, pc_eye);
  MaterialPlace place = material_place(toward);
  Surface surface = material_seen(place);
  shadow_write();
#ifdef MATERIAL_CULLS
  /* The lamp is on the other side of the face. */
  if (dot(v_normal, place.geometric) > 0.0) {
    discard;
  }
#endif
  if (material_is_passed(surface.coverage)) {
    discard;
  }
}
