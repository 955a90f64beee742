/* How open the half space above a surface is: one ray a sample through the voxels, the more of them the steeper. */
#include "frame/voxel_lib.glsl"
#include "lib/octahedron_lib.glsl"
#include "lib/sampling_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  out_color = vec4(0.0, 0.0, 0.0, 1.0);
  if (position.w == 0.0) {
    return;
  }
  vec4 normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(normals.zw);
  vec3 V = math_toward(position.xyz, pc_eye);
  vec2 u = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed));
  /* A point of the unit sphere around the normal's tip lies in a cosine-weighted direction. */
  float z = 1.0 - 2.0 * u.x;
  float angle = 2.0 * MATH_PI * u.y;
  vec3 on_sphere = vec3(sqrt(max(1.0 - z * z, 0.0)) * vec2(cos(angle), sin(angle)), z);
  vec3 direction = normalize(1.001 * N + on_sphere);
  float way = voxel_trace(voxel_start_seen(position.xyz, N, V), direction, pc_reach);
  out_color.rgb = vec3(way < 0.0 ? 1.0 : min(way / pc_reach, 1.0));
}
