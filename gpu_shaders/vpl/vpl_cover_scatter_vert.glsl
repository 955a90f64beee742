/* Three vertices add what one emitter's point covers to one cell: a triangle that covers one texel's centre. Each point
 * goes, for every axis, to the side it faces, in cells of three widths: its neighbours may stand for other areas. */
#include "vpl/vpl_cover_lib.glsl"

void main()
{
  int corner = gl_VertexID % 3;
  int axis = gl_VertexID / 3 % 3;
  int wider = gl_VertexID / 9 % 3 - 1;
  int point = gl_VertexID / 27;
  ivec2 texel = pc_origin + ivec2(point % pc_side, point / pc_side);
  vec4 at = texelFetch(position_area_tx, texel, 0);
  vec3 n = texelFetch(normal_kind_tx, texel, 0).xyz;
  vec3 cell = index_place(pc_index, at.xyz);
  bool inside = all(greaterThanEqual(cell, vec3(0.0))) && all(lessThan(cell, vec3(float(VPL_INDEX))));
  v_area = vec4(0.0);
  if (at.w == 0.0 || !inside) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  int scale = cover_scale(at.w, pc_voxel) + wider;
  ivec3 place = cover_place(cover_cell(at.xyz, scale), scale, pc_level, index_side(axis, n[axis]));
  v_area[place.z] = at.w * abs(n[axis]);
  vec2 reach = corner == 0 ? vec2(-0.4, -0.4) : corner == 1 ? vec2(0.8, -0.4) : vec2(-0.4, 0.8);
  gl_Position = vec4(2.0 * (vec2(place.xy) + 0.5 + reach) / vec2(COVER_SIZE) - 1.0, 0.0, 1.0);
}
