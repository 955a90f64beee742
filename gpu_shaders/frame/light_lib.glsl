/* Lights in Cycles' units (docs/lights.md). `intensity` is P / (4 pi) W/sr of a point or spot, P / pi of an area light
 * (W/sr along its axis), the irradiance E of a sun. LIGHT_POINT ... LIGHT_AREA are defines (frame/structs.py). */
#include "lib/math_lib.glsl"

/* Rectangles seen narrower than this are a point of theirs: the sum over their edges would be rounding. */
const float LIGHT_NARROW = 0.02;

/* The cone of a spot: smoothstep between its edge and the blend's inner cone, over the cosine in the light's object
 * space. `d` is the unit direction from the light. */
float light_spot_cone(Light light, vec3 d)
{
  float cosine = -normalize(vec3(dot(d, light.axis_x), dot(d, light.axis_y), dot(d, light.axis_z))).z;
  float t = clamp((cosine - light.spot_cosine) * light.spot_smooth, 0.0, 1.0);
  return cosine <= light.spot_cosine ? 0.0 : t * t * (3.0 - 2.0 * t);
}

/* The spread of an area light: how much of its emitter's radiance leaves toward the unit direction `d`, with Cycles'
 * normalisation. spread_tangent < 0 stands for no limit. */
float light_area_spread(Light light, vec3 d)
{
  if (light.spread_tangent < 0.0) {
    return 1.0;
  }
  float tangent = length(cross(d, light.axis_z)) / max(-dot(d, light.axis_z), 1e-6);
  return max((light.spread_tangent - tangent) * light.spread_normalize, 0.0);
}

/* Radiant intensity in W/sr toward the unit direction `d` (sun: irradiance). */
vec3 light_intensity(Light light, vec3 d)
{
  if (light.kind == LIGHT_SPOT) {
    return light.intensity * light_spot_cone(light, d);
  }
  if (light.kind == LIGHT_AREA) {
    return light.intensity * max(-dot(d, light.axis_z), 0.0) * light_area_spread(light, d);
  }
  return light.intensity;
}

/* The mean of max(N . w, 0) / (a . w) over the projected solid angle of a round emitter about the direction a,
 * N . a = `cosine`, that fills the cone of squared sine `sine_squared` evenly: the cosine itself but where the horizon
 * cuts the emitter (Lagarde & de Rousiers, "Moving Frostbite to Physically Based Rendering", 2014, listing 7). */
float light_round_cosine(float cosine, float sine_squared)
{
  if (cosine * cosine >= sine_squared) {
    return max(cosine, 0.0);
  }
  float sine = sqrt(max(1.0 - cosine * cosine, 1e-12));
  float x = sqrt(max(1.0 / min(sine_squared, 1.0) - 1.0, 1e-12));
  float y = clamp(-x * cosine / sine, -1.0, 1.0);
  float w = sine * sqrt(1.0 - y * y);
  return max((cosine * acos(y) - x * w) / MATH_PI + atan(w / x) / (MATH_PI * sine_squared), 0.0);
}

/* The place of `source` on a round emitter, which seen along the unit vector `axis` is an even disc around its centre. */
vec3 light_round_place(Light light, vec3 axis, vec3 source)
{
  vec3 place = source - light.position;
  return place - axis * dot(axis, place);
}

/* The unit direction to that place from a distance of 1 / `inverse` to the centre. */
vec3 light_round_direction(Light light, vec3 axis, float inverse, vec3 place)
{
  if (light.soft_radius_squared > 0.0) {
    return normalize(axis + place * inverse);
  }
  return axis * sqrt(max(1.0 - dot(place, place) * inverse * inverse, 0.0)) + place * inverse;
}

/* The unit direction from P to the point `source` of any emitter. */
vec3 light_direction(Light light, vec3 P, vec3 source)
{
  if (light.kind == LIGHT_SUN) {
    return source;
  }
  if (light.kind == LIGHT_AREA) {
    vec3 to_light = source - P;
    return to_light * inversesqrt(max(dot(to_light, to_light), 1e-20));
  }
  vec3 center = light.position - P;
  float inverse = inversesqrt(max(dot(center, center), 1e-20));
  vec3 axis = center * inverse;
  return light_round_direction(light, axis, inverse, light_round_place(light, axis, source));
}

/* How wide the emitter is seen from P: about the tangent of half its angle. */
float light_width(Light light, vec3 P)
{
  if (light.kind == LIGHT_SUN) {
    return light.emitter_radius;
  }
  vec3 center = light.position - P;
  return light.emitter_radius * inversesqrt(max(dot(center, center), 1e-20));
}

/* Irradiance / pi from a point or spot light, `source` one point of its emitter (lights.emitter_sample). */
vec3 light_round_unshadowed(Light light, vec3 P, vec3 N, vec3 source)
{
  vec3 center = light.position - P;
  float squared = dot(center, center);
  float radius_squared = light.emitter_radius * light.emitter_radius;
  bool disc = light.soft_radius_squared > 0.0;
  if (squared <= (disc ? 0.0 : radius_squared)) {
    return disc || radius_squared == 0.0 ? vec3(0.0) : light.intensity / (radius_squared * MATH_PI);
  }
  float inverse = inversesqrt(squared);
  vec3 axis = center * inverse;
  vec3 place = light_round_place(light, axis, source);
  vec3 w = light_round_direction(light, axis, inverse, place);
  vec3 intensity = light_intensity(light, -w) / MATH_PI;
  if (light.filtered != 0 && light.kind == LIGHT_POINT) {
    float seen = squared + light.soft_radius_squared;
    return intensity * light_round_cosine(dot(N, axis), radius_squared / seen) / seen;
  }
  float cosine = max(dot(N, w), 0.0);
  if (disc) {
    float distance_squared = squared + dot(place, place);
    return intensity * cosine * dot(axis, w) / distance_squared;
  }
  return intensity * cosine / (max(dot(axis, w), 1e-2) * squared);
}

/* What the edge from a to b, relative to the receiver, adds to twice the irradiance from a polygon of radiance 1 (Baum,
 * Rushmeier & Winget, "Improving radiosity solutions through the use of analytically determined form factors",
 * 1989). */
float light_edge(vec3 a, vec3 b, vec3 N)
{
  vec3 axis = cross(a, b);
  float sine = length(axis);
  return dot(axis, N) * atan(sine, dot(a, b)) / max(sine, 1e-30);
}

/* Whether light_unshadowed() gives a rectangle's whole light. */
bool light_whole_rectangle(Light light, vec3 P)
{
  return light.kind == LIGHT_AREA && light.filtered != 0 && light.round_shape == 0 && light.spread_tangent < 0.0 &&
         light_width(light, P) > LIGHT_NARROW;
}

/* Irradiance / pi from it, if its spread has no limit: from the part of it above the receiver's horizon. */
vec3 light_rectangle_unshadowed(Light light, vec3 P, vec3 N)
{
  vec3 center = light.position - P;
  vec3 x = light.half_size.x * light.axis_x;
  vec3 y = light.half_size.y * light.axis_y;
  vec3 a = center - x - y;
  vec3 entered = vec3(0.0);
  vec3 left = vec3(0.0);
  float sum = 0.0;
  int corner = 0;
  do { /* the fifth edge is that along the horizon */
    int next = corner + 1;
    vec3 b = center + (next == 1 || next == 2 ? x : -x) + (next == 2 || next == 3 ? y : -y);
    float above_a = dot(a, N);
    float above_b = dot(b, N);
    vec3 cut = a + (b - a) * clamp(above_a / (above_a == above_b ? 1.0 : above_a - above_b), 0.0, 1.0);
    entered = above_a <= 0.0 && above_b > 0.0 ? cut : entered;
    left = above_a > 0.0 && above_b <= 0.0 ? cut : left;
    vec3 start = corner == 4 ? left : above_a > 0.0 ? a : cut;
    vec3 end = corner == 4 ? entered : above_b > 0.0 ? b : cut;
    sum += corner == 4 || above_a > 0.0 || above_b > 0.0 ? light_edge(start, end, N) : 0.0;
    a = b;
    corner++;
  } while (corner < 5);
  bool lit = dot(center, light.axis_z) > 0.0;
  float area = 4.0 * light.half_size.x * light.half_size.y;
  return lit ? light.intensity * max(sum, 0.0) / (2.0 * MATH_PI * area) : vec3(0.0);
}

/* Irradiance / pi at P with normal N when the light's whole power leaves from `source` (for a sun: comes from the
 * direction `source`). Where `filtered` is set, points, suns and rectangles give the whole emitter's in closed form. */
vec3 light_unshadowed(Light light, vec3 P, vec3 N, vec3 source)
{
  if (light.kind == LIGHT_SUN) {
    if (light.filtered != 0) {
      float tangent_squared = light.emitter_radius * light.emitter_radius;
      float sine_squared = tangent_squared / (1.0 + tangent_squared);
      return light.intensity * light_round_cosine(dot(N, light.axis_z), sine_squared) / MATH_PI;
    }
    /* Sources are even over the cone; a surface that faces the sun gets its whole strength at any angle. */
    return light.intensity * max(dot(N, source), 0.0) * 2.0 / (MATH_PI * (1.0 + light.spot_cosine));
  }
  if (light.kind != LIGHT_AREA) {
    return light_round_unshadowed(light, P, N, source);
  }
  if (light_whole_rectangle(light, P)) {
    return light_rectangle_unshadowed(light, P, N);
  }
  vec3 to_light = source - P;
  float squared = dot(to_light, to_light);
  if (squared <= 0.0) {
    return vec3(0.0);
  }
  vec3 d = to_light * inversesqrt(squared);
  return light_intensity(light, -d) * max(dot(N, d), 0.0) / (squared * MATH_PI);
}
