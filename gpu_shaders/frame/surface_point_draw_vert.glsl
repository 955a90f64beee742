/* A small triangle around the centre of each point's texel. */

void main()
{
  v_point = pc_first_point + gl_VertexID / 3;
  int texel = surface_point_fetch(point_tx, v_point).texel;
  int corner = gl_VertexID % 3;
  vec2 offset = vec2(0.4 * float(corner - 1), corner == 1 ? 0.4 : -0.3);
  vec2 place = vec2(texel % pc_side, texel / pc_side) + 0.5 + offset;
  gl_Position = vec4(2.0 * place / float(pc_side) - 1.0, 0.0, 1.0);
}
