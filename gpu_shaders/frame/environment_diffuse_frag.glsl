/* Irradiance / pi of the world at a pixel: that of its harmonics, if a ray with the surface's cosine leaves the scene. */
#include "frame/voxel_lib.glsl"
#include "lib/bxdf_lib.glsl"
#include "lib/octahedron_lib.glsl"
#include "lib/sampling_lib.glsl"

/* The polynomials of gpu_shaders/frame/environment_map.py. */
vec3 environment_irradiance(vec3 n)
{
  vec3 light = harmonics.factor_0.rgb + harmonics.factor_1.rgb * n.y + harmonics.factor_2.rgb * n.z;
  light += harmonics.factor_3.rgb * n.x + harmonics.factor_4.rgb * (n.x * n.y) + harmonics.factor_5.rgb * (n.y * n.z);
  light += harmonics.factor_6.rgb * (3.0 * n.z * n.z - 1.0) + harmonics.factor_7.rgb * (n.x * n.z);
  return max(light + harmonics.factor_8.rgb * (n.x * n.x - n.y * n.y), 0.0);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  out_light = vec4(0.0);
  if (position.w <= 0.0 || (int(position.w) & HAS_SKY) != 0) {
    return;
  }
  vec4 normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(normals.xy);
  vec3 geometric = octahedron_decode(normals.zw);
  vec2 u = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed));
  float radius = sqrt(u.x);
  float angle = 2.0 * MATH_PI * u.y;
  vec3 direction = bxdf_frame(N) * vec3(radius * cos(angle), radius * sin(angle), sqrt(max(1.0 - u.x, 0.0)));
  vec3 origin = voxel_start_seen(position.xyz, geometric, math_toward(position.xyz, pc_eye));
  if (dot(direction, geometric) > 0.0 && voxel_trace(origin, direction, 1e30) < 0.0) {
    out_light = vec4(environment_irradiance(N), 1.0);
  }
}
