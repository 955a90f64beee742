/* One sample of a pixel's light from the pool: candidates, the choice of one, and a ray to it. */
#include "vpl/vpl_candidates_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy) * pc_stride + pc_offset;
  out_indirect = vec4(0.0);
  out_direct = vec4(0.0);
  pixel = min(pixel, textureSize(position_tx, 0) - 1);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w == 0.0) {
    return;
  }
  vec3 P = position.xyz;
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  bool visible;
  vec3 carried;
  vec3 emitted;
  Reservoir r = candidates_choose(P, N, geometric, pixel, 0, visible, carried, emitted);
  vec4 light = vec4(candidates_light(r, visible, P, N, geometric), 1.0);
  int kind = vpl_id_kind(r.id);
  if (kind == SOURCE_EMISSION || kind == SOURCE_SKY) {
    out_direct = light;
  } else {
    out_indirect = light;
  }
  out_indirect.rgb += carried;
  out_direct.rgb += emitted;
}
