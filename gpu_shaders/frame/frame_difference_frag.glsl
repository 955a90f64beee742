/* What one sum has more than another; opaque, for a view. */
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 whole = texelFetch(whole_tx, pixel, 0);
  out_color = vec4(max(whole.rgb - texelFetch(part_tx, pixel, 0).rgb, vec3(0.0)), whole.a);
}
