/* Lights in Cycles' units (docs/lights.md). `intensity` is P / (4 pi) W/sr of a point or spot, P / pi of an area light
 * (W/sr along its axis), the irradiance E of a sun. */

const int LIGHT_POINT = 0;
const int LIGHT_SPOT = 1;
const int LIGHT_SUN = 2;
const int LIGHT_AREA = 3;

/* The cone of a spot: smoothstep between its edge and the blend's inner cone, over the cosine. `d` is the unit
 * direction from the light. */
float light_spot_cone(Light light, vec3 d)
{
  vec3 local = vec3(dot(d, light.axis_x), dot(d, light.axis_y), dot(d, light.axis_z));
  float cosine = -normalize(local).z;
  float t = clamp((cosine - light.spot_cosine) * light.spot_smooth, 0.0, 1.0);
  return cosine <= light.spot_cosine ? 0.0 : t * t * (3.0 - 2.0 * t);
}

/* The spread of an area light: how much of its emitter's radiance leaves at `cosine` to its axis, with Cycles'
 * normalisation. spread_tangent < 0 stands for no limit. */
float light_area_spread(Light light, float cosine)
{
  if (light.spread_tangent < 0.0) {
    return 1.0;
  }
  float tangent = sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 1e-6);
  return max((light.spread_tangent - tangent) * light.spread_normalize, 0.0);
}

/* Radiant intensity in W/sr toward the unit direction `d` (sun: irradiance). */
vec3 light_intensity(Light light, vec3 d)
{
  if (light.kind == LIGHT_SPOT) {
    return light.intensity * light_spot_cone(light, d);
  }
  if (light.kind == LIGHT_AREA) {
    float cosine = max(-dot(d, light.axis_z), 0.0);
    return light.intensity * cosine * light_area_spread(light, cosine);
  }
  return light.intensity;
}

/* Irradiance / pi at P with normal N when the light's whole power leaves from `source` (for a sun: comes from the
 * direction `source`). `soft_area` is added to the squared distance: a disc emitter that turns to the receiver. */
vec3 light_unshadowed(Light light, vec3 P, vec3 N, vec3 source)
{
  if (light.kind == LIGHT_SUN) {
    return light.intensity * max(dot(N, source), 0.0) / 3.14159265358979;
  }
  vec3 to_light = source - P;
  float squared = dot(to_light, to_light);
  if (squared <= 0.0) {
    return vec3(0.0);
  }
  vec3 d = to_light * inversesqrt(squared);
  float cosine = max(dot(N, d), 0.0);
  vec3 center = light.kind == LIGHT_AREA ? to_light : light.position - P;
  float distance_squared = dot(center, center) + light.soft_radius_squared;
  return light_intensity(light, -d) * cosine / (distance_squared * 3.14159265358979);
}
