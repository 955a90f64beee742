/* One part of what a face of a light's map holds, texel by texel. */
#include "frame/map_lib.glsl"
#include "lib/math_lib.glsl"

void main()
{
  MapFace face = map_face_fetch(face_tx, pc_face);
  ivec2 texel = ivec2(face.origin) + min(ivec2(uv * face.tile), ivec2(int(face.tile) - 1));
  vec4 position_area = texelFetch(position_area_tx, texel, 0);
  float depth = texelFetch(depth_tx, texel, 0).x;
  out_color = vec4(0.0, 0.0, 0.0, 1.0);
  if (position_area.w <= 0.0 || depth >= 1.0) {
    return;
  }
  if (pc_part == PART_DEPTH) {
    float closeness = map_closeness(face, depth);
    out_color.rgb = vec3(1.0 - (face.perspective != 0 ? 1.0 / closeness : -closeness));
  } else if (pc_part == PART_POSITION) {
    out_color.rgb = clamp((position_area.xyz - pc_low) / (pc_high - pc_low), 0.0, 1.0);
  } else if (pc_part == PART_NORMAL) {
    out_color.rgb = 0.5 + 0.5 * texelFetch(normal_tx, texel, 0).xyz;
  } else {
    out_color.rgb = texelFetch(flux_tx, texel, 0).rgb / (MATH_PI * position_area.w);
  }
}
