/* One texel of a reflective shadow map (Dachsbacher & Stamminger 2005, section 3): where the light falls, how the
 * surface lies there, and the flux it sends back. The flux takes the light through the texel times the albedo; the
 * receiver's cosine is not in it: it cancels against the surface's projected area. */
#include "frame/light_lib.glsl"
#include "frame/map_lib.glsl"
#include "frame/material_mesh_lib.glsl"
#include "lib/lobe_lib.glsl"

/* A texel's footprint grows as 1 / cosine on a surface that the light only grazes; no flux of note comes from beyond
 * this cosine. */
const float REFLECTIVE_GRAZING = 1e-2;

void main()
{
  Light light = reflected_light;
  vec3 to_light = light.kind == LIGHT_SUN ? light.axis_z : light.position - v_position;
  float distance_squared = light.kind == LIGHT_SUN ? 1.0 : max(dot(to_light, to_light), 1e-20);
  vec3 d = to_light * inversesqrt(max(dot(to_light, to_light), 1e-20));
  MaterialPlace place = material_place(d);
  vec3 geometric = place.geometric;

  /* The solid angle of the texel (sun: its area across the light): pc_texel_measure is its area at z = 1, and
   * cos^3 turns that into solid angle. z / distance is the cosine to the face's axis. */
  float measure = pc_texel_measure;
  if (light.kind != LIGHT_SUN) {
    float cosine = 1.0 / (gl_FragCoord.w * sqrt(distance_squared));
    measure *= cosine * cosine * cosine;
  }
  Surface surface = material_drawn(place);
  float reflects = (v_drawn.w & VISIBILITY_BOUNCE) != 0 ? 1.0 : 0.0;
  /* A sun's wide map sends no light from where the one inside it does. */
  if (pc_served >= 0) {
    MapFace inner = map_face_fetch(face_tx, pc_served);
    if (map_holds(inner, map_position(inner, v_position))) {
      reflects = 0.0;
    }
  }
  vec3 flux = light_intensity(light, -d) * measure * reflects;
  /* A disc that turns to the receiver gives 1 / (d^2 + r^2) where a point gives 1 / d^2. */
  flux *= distance_squared / (distance_squared + light.soft_radius_squared);
  float area = measure * distance_squared / max(dot(geometric, d), REFLECTIVE_GRAZING);

  gl_FragDepth = pc_perspective != 0 ? map_depth(1.0 / (pc_far * gl_FragCoord.w)) : clamp(gl_FragCoord.z, 0.0, 1.0);
  out_position_area = vec4(v_position, area);
  out_normal = vec4(place.normal, float(SOURCE_BOUNCE));
  out_flux = vec4(flux * surface.albedo, 1.0);
  out_specular = vec4(flux * surface.specular, lobe_pack(surface.roughness, d));
}
