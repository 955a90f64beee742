/* Irradiance / pi between the vertices. The position's w says that the light of the sky is here already. */
#ifdef MIXED
#include "prt/prt_rows_lib.glsl"
#endif

void main()
{
  out_position = vec4(v_position, 1.0 + float(prt_draw.has));
#ifdef MIXED
  ivec3 rows;
  vec3 weights;
  prt_find(rows, weights);
  vec3 light = mat3(prt_number(rows.x, 0).rgb, prt_number(rows.y, 0).rgb, prt_number(rows.z, 0).rgb) * weights;
#else
  vec3 light = v_light;
#endif
  out_diffuse = vec4(max(light, vec3(0.0)), 1.0);
  out_glossy = vec4(0.0);
}
