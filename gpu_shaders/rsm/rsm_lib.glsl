/* A texel of a reflective shadow map as a small lamp. */

/* Irradiance / pi at P with normal N from a Lambertian texel: radiant intensity (flux / pi) cos, the receiver's cosine, and
 * the inverse square. Dachsbacher & Stamminger 2005, eq. 1, with the 1 / pi that it leaves out. d^2 + A / pi in place of d^2 is the
 * exact irradiance on the axis of a disc of the texel's own area A, so touching surfaces stay bounded and the
 * difference vanishes with the map's resolution. */
vec3 rsm_texel_irradiance(ivec2 texel, sampler2D position_area_tx, sampler2D rsm_normal_tx, sampler2D flux_tx, vec3 P,
                          vec3 N)
{
  vec3 flux = texelFetch(flux_tx, texel, 0).rgb;
  vec4 lamp = texelFetch(position_area_tx, texel, 0);
  vec3 n = texelFetch(rsm_normal_tx, texel, 0).xyz;
  vec3 d = lamp.xyz - P;
  float squared = dot(d, d);
  float cosines = max(dot(N, d), 0.0) * max(-dot(n, d), 0.0);
  const float PI = 3.14159265358979;
  /* An empty texel lies at the origin with no area: a pixel that is there too must not divide by 0. */
  return flux * (cosines / (PI * PI * max(squared * (squared + lamp.w / PI), 1e-30)));
}

/* Whether interpolation has served this pixel already; a 1 x 1 texture stands for one answer everywhere. */
bool rsm_reused(sampler2D reused_tx, ivec2 pixel)
{
  return texelFetch(reused_tx, min(pixel, textureSize(reused_tx, 0) - 1), 0).r > 0.5;
}
