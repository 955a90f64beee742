/* What a glossy surface shows of the world: one ray of its lobe, where that leaves the scene. */
#include "frame/voxel_lib.glsl"
#include "lib/bxdf_lib.glsl"
#include "lib/environment_lib.glsl"
#include "lib/sampling_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  vec4 specular = texelFetch(specular_tx, pixel, 0);
  out_light = vec4(0.0);
  bool has = (int(position.w) & HAS_SKY_MIRRORED) != 0;
  if (position.w <= 0.0 || has || specular.rgb == vec3(0.0)) {
    return;
  }
  vec4 normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(normals.xy);
  vec3 geometric = octahedron_decode(normals.zw);
  vec3 V = math_toward(position.xyz, pc_eye);
  vec2 u = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 1));
  vec3 direction = bxdf_sample_ggx(N, V, specular.a, u);
  vec3 weight = bxdf_specular_weight(N, V, direction, specular.rgb, specular.a);
  if (dot(direction, geometric) <= 0.0 || weight == vec3(0.0)) {
    return;
  }
  if (voxel_trace(voxel_start_seen(position.xyz, geometric, V), direction, 1e30) < 0.0) {
    float level = environment_level_of_ray(environment_tx, bxdf_sample_density(N, V, direction, specular.a), pc_sample);
    out_light = vec4(weight * environment_radiance(environment_tx, direction, level), 1.0);
  }
}
