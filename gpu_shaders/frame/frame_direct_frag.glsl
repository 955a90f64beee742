#include "frame/light_map_lib.glsl"
#include "frame/shadow_lib.glsl"
#include "lib/octahedron_lib.glsl"

/* Where this pixel's light comes from: the light's own sample of this frame, or, where shadows are filtered, a point of
 * the emitter of the pixel's own. */
vec3 direct_source(Light light, vec3 P, vec2 noise)
{
  bool spot = light.kind == LIGHT_SPOT && light.emitter_radius > 0.0;
  if (light.filtered == 0 || !(spot || light.kind == LIGHT_AREA)) {
    return light.source;
  }
  vec2 place = 2.0 * noise - 1.0;
  if (spot || light.round_shape != 0) {
    place = sqrt(noise.x) * vec2(cos(2.0 * MATH_PI * noise.y), sin(2.0 * MATH_PI * noise.y));
  }
  if (spot) {
    vec3 axis = normalize(light.position - P);
    vec3 side = normalize(cross(axis, abs(axis.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));
    return light.position + light.emitter_radius * (place.x * side + place.y * cross(axis, side));
  }
  return light.position + place.x * light.half_size.x * light.axis_x + place.y * light.half_size.y * light.axis_y;
}

float direct_visibility(Light light, vec3 P, vec3 geometric, vec2 noise)
{
  if (light.face_count == 0) {
    return 1.0;
  }
  int index = light_map_face(light, face_tx, P);
  MapFace face = map_face_fetch(face_tx, index);
  /* A sized spot reaches a little beyond the cone of the point that its map was drawn from: the map's edge answers. */
  bool spot = light.kind == LIGHT_SPOT && light.emitter_radius > 0.0 && light.face_count == 1;
  vec3 p = map_position(face, P);
  if (!map_holds(face, p) && !(spot && p.z > face.near)) {
    return 1.0;
  }
  if (light.filtered != 0 && light.emitter_radius > 0.0) {
    /* The face before an area light has its axes; seen from its side, a round emitter has to do. */
    bool before = light.kind == LIGHT_AREA && index == light.first_face;
    vec2 radius = before ? light.half_size : vec2(light.emitter_radius);
    return shadow_soft(face, shadow_depth_tx, shadow_slope_tx, P, geometric, radius, noise);
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
    vec2 noise = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 2 * i));
    vec3 source = direct_source(light, position.xyz, noise);
    bool whole = light.filtered != 0 && light.kind != LIGHT_AREA;
    vec3 direction = light.kind == LIGHT_SUN ? source : (whole ? light.position : source) - position.xyz;
    vec3 irradiance = light_unshadowed(light, position.xyz, N, source);
    /* The upper part of a light whose centre is below the horizon still shines. */
    float below = whole ? light.emitter_radius : 0.0;
    if (dot(geometric, direction) > -below && any(greaterThan(irradiance, vec3(0.0)))) {
      noise = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 2 * i + 1));
      sum += irradiance * direct_visibility(light, position.xyz, geometric, noise);
    }
  }
  out_direct = vec4(sum, 0.0);
}
