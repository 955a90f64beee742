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
  Reservoir r = candidates_choose(P, N, geometric, pixel, pc_candidates, visible);
  if (r.id == 0) {
    return;
  }
  Vpl vpl = vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, r.id);
  if (!visible && pc_occluded != 0 && !voxel_visible(P, geometric, vpl.position, vpl.normal)) {
    return;
  }
  vec3 light = vpl_light(vpl, P, N) * (r.sum / r.target);
  int kind = vpl_id_kind(r.id);
  if (kind == VPL_EMISSION || kind == VPL_SKY) {
    out_direct = vec4(light, 1.0);
  } else {
    out_indirect = vec4(light, 1.0);
  }
}
