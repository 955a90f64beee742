/* The sky as an octahedral map of far patches: each a surface that looks at the scene and sends the world's radiance. */
#include "lib/environment_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

void main()
{
  vec2 place = 2.0 * (gl_FragCoord.xy - pc_viewport.xy) / pc_viewport.zw - 1.0;
  vec3 direction = octahedron_decode(place);
  /* Solid angle of a texel: its area on the octahedron, 4 / texels, over the cube of its distance there, times the cosine
   * of the face, which is 1 / sqrt(3) of the distance's measure: (4 / texels) / |p|^3 with p on |x| + |y| + |z| = 1. */
  float scale = 1.0 / (abs(direction.x) + abs(direction.y) + abs(direction.z));
  float omega = 4.0 / (pc_viewport.z * pc_viewport.w * scale * scale * scale);
  float area = omega * pc_sphere.w * pc_sphere.w;
  float level = environment_level_of(environment_tx, 4.0 * MATH_PI / (pc_viewport.z * pc_viewport.w));
  vec3 radiance = environment_radiance(environment_tx, direction, level);
  out_position_area = vec4(pc_sphere.xyz + pc_sphere.w * direction, area);
  out_normal = vec4(-direction, float(SOURCE_SKY));
  out_flux = vec4(pc_diffuse * MATH_PI * area * radiance, pc_counts);
  out_specular = vec4(0.0);
}
