/* Which pixels gather, and how well the four around each of the others lie on its surface. */
#include "vpl/vpl_surface_lib.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_color = vec4(0.0, 0.0, 0.0, 1.0);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w <= 0.0) {
    return;
  }
  ivec2 from_first = pixel - pc_offset;
  if (all(greaterThanEqual(from_first, ivec2(0))) && from_first % pc_stride == ivec2(0)) {
    out_color.rgb = vec3(1.0);
    return;
  }
  vec3 N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  ivec2 lower = ivec2(floor(vec2(from_first) / float(pc_stride)));
  ivec2 last = textureSize(surface_tx, 0) - 1;
  float alike = 0.0;
  for (int i = 0; i < 4; i++) {
    Gatherer other = surface_unpack(texelFetch(surface_tx, clamp(lower + ivec2(i & 1, i >> 1), ivec2(0), last), 0));
    alike += other.exists ? 0.25 * surface_alike(Gatherer(position.xyz, N, true), other) : 0.0;
  }
  out_color.rgb = vec3(1.0 - alike, alike, 0.0);
}
