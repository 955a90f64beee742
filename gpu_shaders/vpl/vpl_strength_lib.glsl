/* How strong a light is: what virtual point lights are chosen in proportion to. The plain mean of the channels: a deep
 * blue lamp is not to be noisier than a green one. */

float vpl_strength(vec3 light)
{
  return (light.r + light.g + light.b) * (1.0 / 3.0);
}

float vpl_texel_strength(sampler2D flux_tx, sampler2D specular_tx, ivec2 texel)
{
  vec4 flux = texelFetch(flux_tx, texel, 0);
  return flux.w * (vpl_strength(flux.rgb) + vpl_strength(texelFetch(specular_tx, texel, 0).rgb));
}
