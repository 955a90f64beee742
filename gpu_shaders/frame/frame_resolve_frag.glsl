void main()
{
  out_color = texelFetch(sum_tx, ivec2(gl_FragCoord.xy), 0) * pc_weight;
}
