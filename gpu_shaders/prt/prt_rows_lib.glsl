/* Rows of light: which three a pixel mixes, those of its triangle's corners or of points inside it, and their numbers. */

vec4 prt_number(int row, int i)
{
  ivec2 first = ivec2(row % prt_draw.row * prt_draw.texels, row / prt_draw.row);
  return texelFetch(light_tx, first + ivec2(i, 0), 0);
}

#ifdef REFINED
/* Down the cuts of a triangle, each across one edge, to the part that the pixel is in. Twin of walk() in
 * bake/refine.py. */
void prt_walk(int node, inout ivec3 rows, inout vec3 weights)
{
  for (int depth = 0; depth < PRT_DEEPEST; depth++) {
    vec4 cut = texelFetch(tree_tx, ivec2(node % PRT_ROW, node / PRT_ROW), 0);
    if (cut.x == 0.0) {
      return;
    }
    int edge = int(cut.z);
    rows = edge == 0 ? rows : (edge == 1 ? rows.yzx : rows.zxy);
    weights = edge == 0 ? weights : (edge == 1 ? weights.yzx : weights.zxy);
    bool near_first = weights.x >= weights.y;
    float less = 2.0 * min(weights.x, weights.y);
    float apart = abs(weights.x - weights.y);
    rows = near_first ? ivec3(rows.x, int(cut.y), rows.z) : ivec3(int(cut.y), rows.yz);
    weights = near_first ? vec3(apart, less, weights.z) : vec3(less, apart, weights.z);
    node = int(cut.x) + (near_first ? 0 : 1);
  }
}
#endif

void prt_find(out ivec3 rows, out vec3 weights)
{
  rows = v_triangle.xyz;
  weights = v_weights;
#ifdef REFINED
  prt_walk(v_triangle.w, rows, weights);
#endif
}
