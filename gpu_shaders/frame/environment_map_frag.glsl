/* A texel of the world's octahedral map: the mean over it, so that nothing bright falls between two texels. */
#include "frame/environment_graph_lib.glsl"
#include "lib/octahedron_lib.glsl"

void main()
{
  vec2 corner = gl_FragCoord.xy - 0.5;
  float footprint = 3.54 / (pc_side * float(pc_steps)); /* the root of 4 pi over all directions */
  vec3 sum = vec3(0.0);
  for (int k = 0; k < pc_steps * pc_steps; k++) {
    vec2 part = (vec2(k % pc_steps, k / pc_steps) + 0.5) / float(pc_steps);
    vec3 direction = octahedron_decode(2.0 * (corner + part) / pc_side - 1.0);
    sum += graph_radiance(direction, 0.0, footprint, vec3(0.5, 0.5, 0.0), mat4(1.0));
  }
  out_radiance = vec4(sum / float(pc_steps * pc_steps), 1.0);
}
