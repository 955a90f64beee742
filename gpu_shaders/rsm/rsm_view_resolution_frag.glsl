/* Which pixels gathered for themselves. */

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  bool reused = pc_interpolates != 0 && texelFetch(reused_tx, pixel, 0).x > 0.0;
  bool surface = texelFetch(position_tx, pixel, 0).w > 0.0;
  out_color = vec4(surface ? (reused ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0)) : vec3(0.0), 1.0);
}
