/* Add one sample to every pass. Lighting passes are kept times their colour and divided by it at the end, as Cycles
 * does, so that (direct + indirect) * colour is right on the edges too. */

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 albedo = texelFetch(albedo_tx, pixel, 0);
  vec3 emission = texelFetch(emission_tx, pixel, 0).rgb;
  vec3 direct = texelFetch(diffuse_direct_tx, pixel, 0).rgb * albedo.rgb;
  vec3 indirect = texelFetch(diffuse_indirect_tx, pixel, 0).rgb * albedo.rgb;
  vec3 glossy = texelFetch(glossy_direct_tx, pixel, 0).rgb + texelFetch(glossy_indirect_tx, pixel, 0).rgb;
  bool background = albedo.a == 0.0;
  vec3 environment = background ? pc_background.rgb : vec3(0.0);
  float alpha = background ? pc_background.a : max(albedo.a, 0.0);
  out_combined = vec4(direct + indirect + glossy + emission + environment, alpha);
  out_diffuse_direct = vec4(direct, 0.0);
  out_diffuse_indirect = vec4(indirect, 0.0);
  out_diffuse_color = vec4(albedo.rgb, 0.0);
  out_emission = vec4(emission, 0.0);
  out_environment = vec4(environment, 0.0);
}
