/* Let the points that gather next forget: what they have weighs at most as much as pc_most rounds of gathering. */

void main()
{
  ivec2 point = ivec2(gl_FragCoord.xy);
  out_sum = texelFetch(sum_tx, point, 0);
  out_sky = texelFetch(sky_tx, point, 0);
  if (point.y >= pc_rows.x && point.y < pc_rows.y) {
    out_sky *= min(1.0, pc_most / max(out_sky.w, 1.0));
    out_sum *= min(1.0, pc_most / max(out_sum.w, 1.0));
  }
}
