/* Joint bilateral upsampling (Kopf et al. 2007): the four coarse pixels around, weighted by nearness and by how well their
 * plane and normal agree with the pixel's own. */
#include "lib/octahedron_lib.glsl"

/* What the worst of neighbours still weighs: a pixel that agrees with none takes the nearest all the same. */
const float UPSAMPLE_LEAST = 1e-4;

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_light = vec4(0.0);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w == 0.0) {
    return;
  }
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec2 place = vec2(pixel - pc_offset) / float(pc_stride);
  ivec2 lower = ivec2(floor(place));
  vec2 part = place - vec2(lower);
  ivec2 last = textureSize(coarse_tx, 0) - 1;
  ivec2 last_pixel = textureSize(position_tx, 0) - 1;
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    ivec2 coarse = clamp(lower + corner, ivec2(0), last);
    ivec2 source = min(coarse * pc_stride + pc_offset, last_pixel);
    vec4 other = texelFetch(position_tx, source, 0);
    if (other.w == 0.0) {
      continue;
    }
    vec3 apart = other.xyz - position.xyz;
    float plane = abs(dot(apart, N));
    float flat_enough = exp2(-16.0 * plane * inversesqrt(max(dot(apart, apart), 1e-20)));
    float facing = max(dot(N, octahedron_decode(texelFetch(normal_tx, source, 0).xy)), 0.0);
    facing *= facing;
    facing *= facing;
    vec2 near = mix(1.0 - part, part, vec2(corner)) + 0.01;
    float weight = near.x * near.y * (facing * facing * flat_enough + UPSAMPLE_LEAST);
    sum += weight * texelFetch(coarse_tx, coarse, 0).rgb;
    weights += weight;
  }
  out_light = vec4(weights > 0.0 ? sum / weights : vec3(0.0), 1.0);
}
