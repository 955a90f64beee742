/* GGX reflection (Walter et al. 2007) of a surface whose facets reflect by Schlick's Fresnel term, F0 at normal and 1 at
 * grazing incidence. Light that a facet sends onto others is put back as Cycles does, by one factor that depends on the
 * view (Turquin, "Practical multiple scattering compensation for microfacet models", 2019; the colour of many bounces:
 * Kulla & Conty 2017). Roughness is 0..1, alpha its square. N, V and L are unit vectors, V and L away from the surface.
 * For a dielectric of IOR 1.4 to 2 Schlick's term is within 0.05 of the exact one, and within 0.01 on average over all
 * directions. */
#include "lib/math_lib.glsl"

/* No lobe is narrower: a point of light would be brighter than a picture holds. */
const float BXDF_LEAST_ALPHA = 1e-3;
/* A view from below the shading normal's horizon is taken for one just above it. */
const float BXDF_LEAST_COSINE = 1e-3;
/* The cosine at which a dielectric layer reflects as much as it does on average over all directions of even light. */
const float BXDF_MEAN_COSINE = 0.46;

float bxdf_alpha(float roughness)
{
  return clamp(roughness * roughness, BXDF_LEAST_ALPHA, 1.0);
}

vec3 bxdf_fresnel(vec3 F0, float cosine)
{
  float c = clamp(1.0 - cosine, 0.0, 1.0);
  return F0 + (1.0 - F0) * (c * c * c * c * c);
}

/* What a lobe with F = 1 reflects without the light of several bounces; fitted to its integral, relative error below
 * 0.005 (below a cosine of 0.025: 0.015). */
float bxdf_single_albedo(float cosine, float roughness)
{
  float a = bxdf_alpha(roughness);
  float x = cosine / (cosine + a);
  vec4 powers = vec4(1.0, a, a * a, a * a * a);
  float missing = dot(vec4(3.67075, -9.39423, -13.8175, 15.5716), powers);
  missing = missing * x + dot(vec4(-7.91257, 23.6175, 2.49096, -10.8172), powers);
  missing = missing * x + dot(vec4(5.20114, -19.2801, 11.4373, -2.75508), powers);
  missing = missing * x + dot(vec4(-1.05464, 5.78859, -3.88502, 1.82238), powers);
  missing = missing * x + dot(vec4(0.0995807, -0.51328, 0.808141, -0.360747), powers);
  return 1.0 - clamp(missing, 0.0, 0.9);
}

/* The part of it that Schlick's (1 - cosine)^5 gets; fitted, error below 0.007 (below a cosine of 0.025: 0.015). */
float bxdf_grazing_albedo(float cosine, float roughness)
{
  float a = bxdf_alpha(roughness);
  float x = cosine / (cosine + a);
  float c = 1.0 - cosine;
  vec4 powers = vec4(1.0, sqrt(a), a, a * a);
  float value = dot(vec4(1.15116, -3.02134, 2.3539, -0.459444), powers);
  value += x * dot(vec4(-0.512104, 0.914959, 0.161202, 0.00334718), powers);
  value += x * x * dot(vec4(0.345671, 3.21173, -7.28215, -0.522062), powers);
  value += x * x * cosine * dot(vec4(-1.06429, -2.39174, 13.274, -4.62062), powers);
  return max(value, 0.0) * c * c * c * c;
}

/* bxdf_single_albedo() averaged over all directions of even light; fitted, error below 0.003. */
float bxdf_mean_albedo(float roughness)
{
  float a = bxdf_alpha(roughness);
  return 1.0 - (-0.00262521 + a * (0.161824 + a * (1.7278 + a * (-2.06259 + a * 0.768404))));
}

/* The factor by which light of several bounces makes a lobe brighter, seen from `cosine`. */
vec3 bxdf_compensation(vec3 F0, float roughness, float cosine)
{
  float albedo = bxdf_single_albedo(cosine, roughness);
  float mean = bxdf_mean_albedo(roughness);
  vec3 F = mix(F0, vec3(1.0), 1.0 / 21.0); /* Schlick's term averaged over all directions */
  return 1.0 + F * mean / (1.0 - F * (1.0 - mean)) * (1.0 - albedo) / albedo;
}

/* What the whole lobe reflects of even light, seen from `cosine`. */
vec3 bxdf_albedo(vec3 F0, float roughness, float cosine)
{
  cosine = clamp(cosine, BXDF_LEAST_COSINE, 1.0);
  float single = bxdf_single_albedo(cosine, roughness);
  float grazing = min(bxdf_grazing_albedo(cosine, roughness), single);
  return min((F0 * (single - grazing) + grazing) * bxdf_compensation(F0, roughness, cosine), vec3(1.0));
}

/* Smith's Lambda of a direction at `cosine` to the normal. */
float bxdf_lambda(float cosine, float alpha)
{
  float tangent_squared = max(1.0 / (cosine * cosine) - 1.0, 0.0);
  return 0.5 * (sqrt(1.0 + alpha * alpha * tangent_squared) - 1.0);
}

/* GGX's density of normals, per solid angle of H. The cross product keeps its peak exact in 32 bits. */
float bxdf_normals(vec3 N, vec3 H, float alpha)
{
  vec3 sine = cross(N, H);
  float cosine = dot(N, H);
  float k = dot(sine, sine) + alpha * alpha * cosine * cosine;
  return alpha * alpha / (MATH_PI * k * k);
}

/* The BRDF (without the cosine), 1/sr. */
vec3 bxdf_specular(vec3 N, vec3 V, vec3 L, vec3 F0, float roughness)
{
  float to_light = dot(N, L);
  if (to_light <= 0.0) {
    return vec3(0.0);
  }
  float to_eye = max(dot(N, V), BXDF_LEAST_COSINE);
  float alpha = bxdf_alpha(roughness);
  vec3 H = normalize(V + L);
  float shadowing = 1.0 / (1.0 + bxdf_lambda(to_eye, alpha) + bxdf_lambda(to_light, alpha));
  float f = bxdf_normals(N, H, alpha) * shadowing / (4.0 * to_light * to_eye);
  return f * bxdf_fresnel(F0, dot(V, H)) * bxdf_compensation(F0, roughness, to_eye);
}

/* A rotation whose third column is N (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017). */
mat3 bxdf_frame(vec3 N)
{
  float s = N.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (s + N.z);
  float b = N.x * N.y * a;
  return mat3(vec3(1.0 + s * N.x * N.x * a, s * b, -s * N.x), vec3(b, s + N.y * N.y * a, -N.y), N);
}

/* V, or a direction just above the horizon in place of one below it. */
vec3 bxdf_above(vec3 N, vec3 V)
{
  return normalize(V + N * max(BXDF_LEAST_COSINE - dot(N, V), 0.0));
}

/* A reflected direction of the density bxdf_sample_density(): off a normal that V sees, from a cap of a sphere (Dupuy &
 * Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023). It can lie below the horizon, with weight 0. */
vec3 bxdf_sample_ggx(vec3 N, vec3 V, float roughness, vec2 xi)
{
  float alpha = bxdf_alpha(roughness);
  mat3 world_from_local = bxdf_frame(N);
  vec3 v = bxdf_above(N, V) * world_from_local;
  vec3 w = normalize(vec3(alpha * v.xy, v.z));
  float angle = 2.0 * MATH_PI * xi.x;
  float z = 1.0 - xi.y * (1.0 + w.z);
  float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
  vec3 h = vec3(sine * cos(angle), sine * sin(angle), z) + w;
  h = normalize(vec3(alpha * h.xy, max(h.z, 1e-7)));
  return world_from_local * reflect(-v, h);
}

/* The density of bxdf_sample_ggx() per solid angle of L. */
float bxdf_sample_density(vec3 N, vec3 V, vec3 L, float roughness)
{
  float to_eye = max(dot(N, V), BXDF_LEAST_COSINE);
  float alpha = bxdf_alpha(roughness);
  return bxdf_normals(N, normalize(V + L), alpha) / (4.0 * to_eye * (1.0 + bxdf_lambda(to_eye, alpha)));
}

/* BRDF times cosine over density of a direction L of bxdf_sample_ggx(). */
vec3 bxdf_specular_weight(vec3 N, vec3 V, vec3 L, vec3 F0, float roughness)
{
  float to_light = dot(N, L);
  if (to_light <= 0.0) {
    return vec3(0.0);
  }
  float to_eye = max(dot(N, V), BXDF_LEAST_COSINE);
  float alpha = bxdf_alpha(roughness);
  float seen = 1.0 + bxdf_lambda(to_eye, alpha);
  vec3 F = bxdf_fresnel(F0, dot(V, normalize(V + L)));
  return F * bxdf_compensation(F0, roughness, to_eye) * (seen / (seen + bxdf_lambda(to_light, alpha)));
}
