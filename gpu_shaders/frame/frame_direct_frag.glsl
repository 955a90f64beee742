#include "frame/light_map_lib.glsl"
#include "frame/shadow_lib.glsl"
#include "lib/bxdf_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

/* A point of the emitter of the pixel's own (sun: a direction). */
vec3 direct_own_source(Light light, vec3 P, vec2 noise)
{
  vec2 place = 2.0 * noise - 1.0;
  if (light.kind != LIGHT_AREA || light.round_shape != 0) {
    place = sqrt(noise.x) * vec2(cos(2.0 * MATH_PI * noise.y), sin(2.0 * MATH_PI * noise.y));
  }
  if (light.kind == LIGHT_AREA) {
    return light.position + place.x * light.half_size.x * light.axis_x + place.y * light.half_size.y * light.axis_y;
  }
  bool sun = light.kind == LIGHT_SUN;
  vec3 axis = sun ? light.axis_z : normalize(light.position - P);
  vec3 side = normalize(cross(axis, abs(axis.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));
  vec3 aside = light.emitter_radius * (place.x * side + place.y * cross(axis, side));
  return sun ? normalize(axis + aside) : light.position + aside;
}

float direct_visibility(Light light, vec3 P, vec3 geometric, vec2 noise)
{
  if (light.face_count == 0) {
    return 1.0;
  }
#ifdef LIGHT_ONE_FACE
  int index = light.first_face;
  MapFace face = direct_face;
#else
  int index;
  MapFace face = light_map_face(light, face_tx, P, index);
#endif
  face.perspective = light.kind == LIGHT_SUN ? 0 : 1; /* known to the compiler, as the kind is */
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

/* What the surface mirrors toward the eye of the light that leaves the emitter at `source`, W/(m^2 sr). In the first
 * samples a lobe is no narrower than the gaps between the points of the emitter that were seen so far: a narrower one would
 * show them as so many lights. */
vec3 direct_mirrored(Light light, vec3 P, vec3 N, vec3 V, vec4 specular, vec3 source)
{
  light.intensity = light.specular_intensity;
  light.filtered = 0;
  float gap = 0.5 * min(light_width(light, P), 1.0);
  float squared = specular.a * specular.a;
  float roughness = sqrt(sqrt(squared * squared + gap * gap / float(pc_sample + 1)));
  vec3 f = bxdf_specular(N, V, light_direction(light, P, source), specular.rgb, min(roughness, 1.0));
  return MATH_PI * f * light_unshadowed(light, P, N, source);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  out_diffuse = vec4(0.0);
#ifdef GLOSSY
  out_glossy = vec4(0.0);
#endif
  if (position.w == 0.0) {
    return;
  }
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  Light light = direct_light;
  /* Known when this is compiled, so that the compiler drops what other lights need. */
  light.kind = LIGHT_KIND;
  light.filtered = LIGHT_FILTERED;
#ifdef LIGHT_ONE_FACE
  light.face_count = 1;
#endif
  vec2 noise = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed));
  vec3 own_source = light.filtered != 0 ? direct_own_source(light, position.xyz, noise) : light.source;
  /* The irradiance from a whole point light, sun or rectangle has a closed form. */
  bool rectangle = light_whole_rectangle(light, position.xyz);
  bool whole = rectangle || light.filtered != 0 && light.kind != LIGHT_AREA;
  vec3 source = whole && light.kind != LIGHT_SPOT ? light.source : own_source;
  vec3 direction = light.kind == LIGHT_SUN ? source : (whole ? light.position : source) - position.xyz;
  vec3 diffuse = light_unshadowed(light, position.xyz, N, source);
  vec3 glossy = vec3(0.0);
#ifdef GLOSSY
  vec4 specular = texelFetch(specular_tx, pixel, 0);
  if (specular.rgb != vec3(0.0)) {
    vec3 V = math_toward(position.xyz, pc_eye);
    glossy = direct_mirrored(light, position.xyz, N, V, specular, own_source);
  }
#endif
  /* The upper part of a light whose centre is below the horizon still shines. */
  float below = rectangle ? length(light.half_size) : whole ? light.emitter_radius : 0.0;
  if (dot(geometric, direction) > -below && any(greaterThan(diffuse + glossy, vec3(0.0)))) {
    noise = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 1));
    float visible = direct_visibility(light, position.xyz, geometric, noise);
    out_diffuse.rgb = diffuse * visible;
#ifdef GLOSSY
    out_glossy.rgb = glossy * visible;
#endif
  }
}
