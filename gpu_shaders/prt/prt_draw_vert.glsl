/* A baked object again, where the G-buffer has it: one light a vertex, or the vertices to mix for a pixel and the number of the
 * triangle. */
#include "frame/mesh_place_lib.glsl"

void main()
{
  vec4 world = mesh_world(prt_draw.world_from_object, in_position);
  v_position = world.xyz;
  gl_Position = mesh_clip(prt_draw.clip_from_world, world);
  int corner = gl_VertexID % 3;
#ifdef MIXED
  v_triangle = ivec4(in_triangle, gl_VertexID / 3);
  v_weights = vec3(corner == 0, corner == 1, corner == 2);
#else
  int vertex = in_triangle[corner];
  v_light = texelFetch(light_tx, ivec2(vertex % prt_draw.row, vertex / prt_draw.row), 0).rgb;
#endif
}
