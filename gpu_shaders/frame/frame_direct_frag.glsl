#include "frame/light_lib.glsl"
#include "frame/shadow_lib.glsl"
#include "lib/octahedron_lib.glsl"

/* Where this pixel's light comes from: the light's own sample of this frame, or, where shadows are filtered, a point of the
 * emitter of the pixel's own. */
vec3 direct_source(Light light, vec2 noise)
{
  if (light.filtered == 0 || light.kind != LIGHT_AREA) {
    return light.source;
  }
  vec2 place = 2.0 * noise - 1.0;
  if (light.round_shape != 0) {
    place = sqrt(noise.x) * vec2(cos(2.0 * SAMPLING_PI * noise.y), sin(2.0 * SAMPLING_PI * noise.y));
  }
  return light.position + place.x * light.half_size.x * light.axis_x + place.y * light.half_size.y * light.axis_y;
}

float direct_visibility(Light light, vec3 P, vec3 geometric, vec2 noise)
{
  if (light.face_count == 0) {
    return 1.0;
  }
  vec3 d = P - light.map_origin;
  vec3 local = vec3(dot(d, light.axis_x), dot(d, light.axis_y), dot(d, light.axis_z));
  MapFace face = map_face_fetch(face_tx, light.first_face + map_face_of(light.face_count, local));
  if (light.face_count == 2 && !map_holds(face, map_position(face, P))) {
    face = map_face_fetch(face_tx, light.first_face + 1);
  }
  if (!map_holds(face, map_position(face, P))) {
    return 1.0;
  }
  if (light.filtered != 0 && light.blur_radius > 0.0) {
    return shadow_soft(face, shadow_depth_tx, shadow_slope_tx, P, geometric, light.blur_radius, noise);
  }
  return shadow_hard(face, shadow_depth_tx, shadow_slope_tx, P, geometric, noise);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  out_direct = vec4(0.0);
  if (position.w == 0.0) {
    return;
  }
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  vec3 sum = vec3(0.0);
  for (int i = pc_first_light; i < pc_last_light; i++) {
    Light light = light_fetch(light_tx, i);
    vec2 noise = sampling_hash(pixel, pc_seed + 2 * i);
    vec3 source = direct_source(light, noise);
    vec3 direction = light.kind == LIGHT_SUN ? source : source - position.xyz;
    vec3 irradiance = light_unshadowed(light, position.xyz, N, source);
    if (dot(geometric, direction) > 0.0 && any(greaterThan(irradiance, vec3(0.0)))) {
      sum += irradiance * direct_visibility(light, position.xyz, geometric, sampling_hash(pixel, pc_seed + 2 * i + 1));
    }
  }
  out_direct = vec4(sum, 0.0);
}
