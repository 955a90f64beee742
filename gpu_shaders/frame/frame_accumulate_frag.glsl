/* Add one sample to the sums that are wanted. Lighting passes are kept times their colour and divided by it at the end, as
 * Cycles does, so that (direct + indirect) * colour is right on the edges too. */
#include "lib/bxdf_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 albedo = texelFetch(albedo_tx, pixel, 0);
  bool background = albedo.a == 0.0;
  vec3 glow = texelFetch(emission_tx, pixel, 0).rgb;
  vec3 emission = background ? vec3(0.0) : glow;
  vec3 direct = texelFetch(diffuse_direct_tx, pixel, 0).rgb * albedo.rgb;
  vec3 indirect = vec3(0.0);
  vec3 glossy_direct = vec3(0.0);
  vec3 glossy_indirect = vec3(0.0);
#ifdef GLOSSY
  glossy_direct = texelFetch(glossy_direct_tx, pixel, 0).rgb;
#endif
#ifdef INDIRECT
  indirect = texelFetch(diffuse_indirect_tx, pixel, 0).rgb * albedo.rgb;
#ifdef GLOSSY
  glossy_indirect = texelFetch(glossy_indirect_tx, pixel, 0).rgb;
#endif
#endif
#ifdef PANORAMA
  vec3 environment = background ? glow : vec3(0.0); /* environment_background_frag.glsl drew it there */
#else
  vec3 environment = background ? pc_background.rgb : vec3(0.0);
#endif
  float alpha = background ? pc_background.a : max(albedo.a, 0.0);
  vec3 combined = direct + indirect + glossy_direct + glossy_indirect + emission + environment;
#ifdef WANT_COMBINED
  out_combined = vec4(combined, alpha);
#endif
#ifdef WANT_MOMENTS
  float luminance = dot(combined, vec3(0.2126, 0.7152, 0.0722));
  out_moments = vec4(luminance, luminance * luminance, 0.0, 0.0);
#endif
#ifdef PASSED
  /* As in Cycles, what is seen through glass is the glass's, whatever it is there. */
  vec4 passed = texelFetch(passed_tx, pixel, 0);
  float straight = passed.a;
#else
  vec4 passed = vec4(1.0);
  float straight = 1.0;
#endif
#ifdef WANT_TRANSMISSION_DIRECT
  out_transmission_direct = vec4((1.0 - straight) * (emission + environment), 0.0);
#endif
#ifdef WANT_TRANSMISSION_INDIRECT
  out_transmission_indirect = vec4((1.0 - straight) * (direct + indirect + glossy_direct + glossy_indirect), 0.0);
#endif
#ifdef WANT_TRANSMISSION_COLOR
  out_transmission_color = vec4((1.0 - straight) * passed.rgb, 0.0);
#endif
#ifdef WANT_DIFFUSE_DIRECT
  out_diffuse_direct = vec4(straight * direct, 0.0);
#endif
#ifdef WANT_DIFFUSE_INDIRECT
  out_diffuse_indirect = vec4(straight * indirect, 0.0);
#endif
#ifdef WANT_DIFFUSE_COLOR
  out_diffuse_color = vec4(straight * albedo.rgb, 0.0);
#endif
#ifdef WANT_EMISSION
  out_emission = vec4(straight * emission, 0.0);
#endif
#ifdef WANT_ENVIRONMENT
  out_environment = vec4(straight * environment, 0.0);
#endif
#ifdef WANT_GLOSSY_DIRECT
  out_glossy_direct = vec4(straight * glossy_direct, 0.0);
#endif
#ifdef WANT_GLOSSY_INDIRECT
  out_glossy_indirect = vec4(straight * glossy_indirect, 0.0);
#endif
#ifdef WANT_GLOSSY_COLOR
  out_glossy_color = vec4(0.0);
#ifdef GLOSSY
  vec4 specular = texelFetch(specular_tx, pixel, 0);
  if (albedo.a > 0.0 && specular.rgb != vec3(0.0)) {
    vec3 P = texelFetch(position_tx, pixel, 0).xyz;
    vec3 V = math_toward(P, pc_eye);
    vec3 N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
    out_glossy_color = vec4(straight * bxdf_albedo(specular.rgb, specular.a, dot(N, V)), 0.0);
  }
#endif
#endif
}
