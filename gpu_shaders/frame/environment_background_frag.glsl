/* The world behind everything, at this sample's place inside the pixel. */
#include "frame/environment_graph_lib.glsl"

void main()
{
  if (texelFetch(albedo_tx, ivec2(gl_FragCoord.xy), 0).a != 0.0) {
    discard;
  }
  vec2 place = gl_FragCoord.xy / world_view.size;
  vec4 before = world_view.world_from_clip * vec4(2.0 * place - 1.0, 0.0, 1.0);
  vec3 direction = world_view.eye.w > 0.5 ? before.xyz / before.w : -world_view.eye.xyz;
  vec3 radiance = graph_radiance(normalize(direction), 1.0, 0.0, vec3(place, 0.0), world_view.camera_from_world);
  out_emission = vec4(radiance, 1.0);
}
