/* A texel of a reflective shadow map as a small lamp, and the pixel that it shines on. */
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

/* Irradiance / pi at P with normal N from a Lambertian texel: radiant intensity (flux / pi) cos, the receiver's cosine,
 * and the inverse square. Dachsbacher & Stamminger 2005, eq. 1, with the 1 / pi that it leaves out. d^2 + A / pi in
 * place of d^2 is the exact irradiance on the axis of a disc of the texel's own area A, so touching surfaces stay
 * bounded and the difference vanishes with the map's resolution. */
vec3 rsm_texel_light(ivec2 texel, sampler2D position_area_tx, sampler2D rsm_normal_tx, sampler2D flux_tx, vec3 P,
                     vec3 N)
{
  vec3 flux = texelFetch(flux_tx, texel, 0).rgb;
  vec4 lamp = texelFetch(position_area_tx, texel, 0);
  vec3 n = texelFetch(rsm_normal_tx, texel, 0).xyz;
  vec3 d = lamp.xyz - P;
  float squared = dot(d, d);
  float cosines = max(dot(N, d), 0.0) * max(-dot(n, d), 0.0);
  /* An empty texel lies at the origin with no area: a pixel that is there too must not divide by 0. */
  return flux * (cosines / (MATH_PI * MATH_PI * max(squared * (squared + lamp.w / MATH_PI), 1e-30)));
}

struct RsmReceiver {
  vec3 P;
  vec3 N;
  bool gathers; /* false: there is no surface that takes indirect light, or interpolation has served it already */
};

/* What `pixel` of the G-buffer shows. `reused_tx` has one texel for each pixel that is drawn, `drawn`; a texture of one
 * texel stands for one answer everywhere. The last pixels of a coarse grid may lie beyond the picture. */
RsmReceiver rsm_receiver(ivec2 pixel, ivec2 drawn, sampler2D position_tx, sampler2D normal_tx, sampler2D reused_tx)
{
  RsmReceiver receiver = RsmReceiver(vec3(0.0), vec3(0.0, 0.0, 1.0), false);
  if (any(greaterThanEqual(pixel, textureSize(position_tx, 0)))) {
    return receiver;
  }
  vec4 position = texelFetch(position_tx, pixel, 0);
  bool reused = texelFetch(reused_tx, min(drawn, textureSize(reused_tx, 0) - 1), 0).r > 0.5;
  receiver.P = position.xyz;
  receiver.N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  receiver.gathers = position.w > 0.0 && !reused;
  return receiver;
}
