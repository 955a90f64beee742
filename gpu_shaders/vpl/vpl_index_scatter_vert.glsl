/* Three vertices put one point of a tile into one cell of its index: a triangle that covers one texel's centre. Each point
 * goes, for every axis that it faces, to the side it faces. */
#include "vpl/vpl_index_lib.glsl"

/* The least cosine to an axis with which a point counts as facing its way. */
const float SCATTER_FACING = 0.4;

void main()
{
  int corner = gl_VertexID % 3;
  int axis = gl_VertexID / 3 % 3;
  int point = gl_VertexID / 9;
  ivec2 texel = pc_origin + ivec2(point % pc_side, point / pc_side);
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec3 n = texelFetch(normal_kind_tx, texel, 0).xyz;
  v_point = vec4(float(point + 1), index_place(pc_index, place.xyz));
  vec3 cell = floor(v_point.yzw);
  /* Points without light are inside of things, or under them: cells that they share belong to the others. */
  bool sends = any(greaterThan(texelFetch(flux_tx, texel, 0).rgb, vec3(0.0)));
  bool inside = all(greaterThanEqual(cell, vec3(0.0))) && all(lessThan(cell, vec3(float(VPL_INDEX))));
  if (place.w == 0.0 || !sends || !inside || abs(n[axis]) < SCATTER_FACING) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  vec2 center = vec2(index_texel(ivec3(cell), index_side(axis, n[axis]))) + 0.5;
  vec2 reach = corner == 0 ? vec2(-0.4, -0.4) : corner == 1 ? vec2(0.8, -0.4) : vec2(-0.4, 0.8);
  gl_Position = vec4(2.0 * (center + reach) / vec2(INDEX_SIZE) - 1.0, 0.0, 1.0);
}
