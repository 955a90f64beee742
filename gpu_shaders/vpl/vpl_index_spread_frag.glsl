/* Fill empty cells of the index from those around: with the point that lies nearest to the cell's centre. */
#include "vpl/vpl_index_lib.glsl"

void main()
{
  ivec2 base = ivec2(0, pc_level * INDEX_SIZE.y);
  ivec2 texel = ivec2(gl_FragCoord.xy) - base;
  out_point = texelFetch(index_tx, texel + base, 0);
  if (out_point.x != 0.0) {
    return;
  }
  int side = texel.x / VPL_INDEX;
  ivec3 cell = ivec3(texel.x - side * VPL_INDEX, texel.y % VPL_INDEX, texel.y / VPL_INDEX);
  float nearest = 1e30;
  for (int i = 0; i < 6; i++) {
    ivec3 other = cell;
    other[i >> 1] += (i & 1) * 2 - 1;
    if (any(lessThan(other, ivec3(0))) || any(greaterThanEqual(other, ivec3(VPL_INDEX)))) {
      continue;
    }
    vec4 point = texelFetch(index_tx, index_texel(other, side) + base, 0);
    if (point.x == 0.0) {
      continue;
    }
    vec3 apart = point.yzw - (vec3(cell) + 0.5);
    float squared = dot(apart, apart);
    if (squared < nearest) {
      nearest = squared;
      out_point = point;
    }
  }
}
