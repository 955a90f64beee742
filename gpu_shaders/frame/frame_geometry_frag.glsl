#include "lib/octahedron_lib.glsl"

/* Depth, position and normal come from one sample through the pixel's centre: averages of them name no surface. */
const float GEOMETRY_NO_DEPTH = 1e10;

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w == 0.0) {
    out_position_depth = vec4(0.0, 0.0, 0.0, GEOMETRY_NO_DEPTH);
    out_normal = vec4(0.0);
    return;
  }
  float depth = -(pc_view_from_world * vec4(position.xyz, 1.0)).z;
  out_position_depth = vec4(position.xyz, depth);
  out_normal = vec4(octahedron_decode(texelFetch(normal_tx, pixel, 0).xy), 0.0);
}
