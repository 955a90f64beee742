/* Screen-space interpolation (Dachsbacher & Stamminger 2005, section 4.2): where at least three of the four coarse
 * pixels around lie on about the same plane with about the same normal, their irradiance is reused; elsewhere the pixel
 * gathers for itself. */
#include "lib/octahedron_lib.glsl"

const float INTERPOLATE_NORMAL = 0.9;
/* Distance from the plane, in parts of the world distance between two coarse pixels. */
const float INTERPOLATE_PLANE = 0.25;
const int INTERPOLATE_NEEDED = 3;

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_indirect = vec4(0.0);
  out_reused = vec4(0.0);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w <= 0.0) {
    return;
  }
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  ivec2 coarse_size = textureSize(coarse_tx, 0);
  vec2 place = vec2(pixel - pc_offset) / float(pc_stride);
  ivec2 lower = ivec2(floor(place));
  vec2 part = place - vec2(lower);
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  int agreeing = 0;
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    ivec2 coarse = lower + corner;
    if (any(lessThan(coarse, ivec2(0))) || any(greaterThanEqual(coarse, coarse_size))) {
      continue;
    }
    ivec2 source = coarse * pc_stride + pc_offset;
    if (any(greaterThanEqual(source, textureSize(position_tx, 0)))) {
      continue;
    }
    vec4 other = texelFetch(position_tx, source, 0);
    if (other.w <= 0.0) {
      continue;
    }
    vec3 other_N = octahedron_decode(texelFetch(normal_tx, source, 0).xy);
    vec3 apart = other.xyz - position.xyz;
    float plane = max(abs(dot(apart, geometric)), abs(dot(apart, N)));
    if (dot(N, other_N) < INTERPOLATE_NORMAL ||
        plane > INTERPOLATE_PLANE * length(apart) + 1e-6 * length(position.xyz)) {
      continue;
    }
    vec2 near = mix(1.0 - part, part, vec2(corner));
    float weight = near.x * near.y + 1e-4;
    sum += weight * texelFetch(coarse_tx, coarse, 0).rgb;
    weights += weight;
    agreeing++;
  }
  if (agreeing >= INTERPOLATE_NEEDED) {
    out_indirect = vec4(sum / weights, 1.0);
    out_reused = vec4(1.0);
  }
}
