/* One level up the pyramid of strengths. Tiles of `pc_children` texels a side become tiles of `pc_parents`, whose last
 * ones may have fewer than PYRAMID_STEP children a side. */

void main()
{
  ivec2 parent = ivec2(gl_FragCoord.xy);
  ivec2 tile = parent / pc_parents;
  ivec2 first = tile * pc_children + (parent - tile * pc_parents) * PYRAMID_STEP;
  ivec2 end = min(first + PYRAMID_STEP, (tile + 1) * pc_children);
  float sum = 0.0;
  for (int y = first.y; y < end.y; y++) {
    for (int x = first.x; x < end.x; x++) {
      sum += texelFetch(level_tx, ivec2(x, y), 0).r;
    }
  }
  out_sum = vec4(sum);
}
