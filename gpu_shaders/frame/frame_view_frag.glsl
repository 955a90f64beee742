#include "lib/octahedron_lib.glsl"

/* One sample of a view of surfaces; black where there is none. */
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 albedo = texelFetch(albedo_tx, pixel, 0);
  vec3 color = albedo.rgb;
#ifdef VIEW_NORMALS
  color = 0.5 + 0.5 * octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
#endif
#ifdef VIEW_IRRADIANCE
  color = texelFetch(diffuse_direct_tx, pixel, 0).rgb + texelFetch(diffuse_indirect_tx, pixel, 0).rgb;
#endif
  out_color = vec4(albedo.a > 0.0 ? color : vec3(0.0), 1.0);
}
