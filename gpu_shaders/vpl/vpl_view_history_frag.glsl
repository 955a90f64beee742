/* How many samples the mean of each gathering pixel stands for: red for one, green for pc_many or more. */

void main()
{
  ivec2 texel = min(ivec2(gl_FragCoord.xy) / pc_stride, textureSize(history_tx, 0) - 1);
  float samples = texelFetch(history_tx, texel, 0).w;
  float part = clamp((samples - 1.0) / (pc_many - 1.0), 0.0, 1.0);
  out_color = vec4(samples > 0.0 ? vec3(1.0 - part, part, 0.0) : vec3(0.0), 1.0);
}
