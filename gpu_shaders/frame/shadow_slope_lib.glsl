/* Depth, and the slope of closeness over the tile. With the slope a texel is a piece of plane and not a step, so a
 * surface does not shadow itself and no bias in metres is needed (frame/shadow_lib.glsl). */
#include "frame/map_lib.glsl"

void shadow_write()
{
  float closeness, depth;
  if (pc_perspective != 0) {
    closeness = pc_far * gl_FragCoord.w;
    depth = map_depth(1.0 / closeness);
  } else {
    depth = 0.5 * v_depth + 0.5;
    closeness = -depth;
  }
  gl_FragDepth = clamp(depth, 0.0, 1.0);
  out_slope = vec4(clamp(vec2(dFdx(closeness), dFdy(closeness)) * pc_tile, vec2(-6e4), vec2(6e4)), 0.0, 0.0);
}
