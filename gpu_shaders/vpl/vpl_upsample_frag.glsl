/* Joint bilateral upsampling (Kopf et al. 2007): the four gathering pixels around, weighted by nearness and by how well
 * their plane and normal agree with the pixel's own. With GLOSSY, light is over the lobe's albedo until here. */
#include "vpl/vpl_surface_lib.glsl"
#ifdef GLOSSY
#include "lib/bxdf_lib.glsl"
#include "lib/math_lib.glsl"
#endif

/* What the worst of neighbours still weighs: a pixel that agrees with none takes the nearest all the same. */
const float UPSAMPLE_LEAST = 1e-4;

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_light = vec4(0.0);
  vec4 position = texelFetch(position_tx, pixel, 0);
  if (position.w <= 0.0) {
    return;
  }
#ifdef GLOSSY
  vec4 specular = texelFetch(specular_color_tx, pixel, 0);
  if (specular.rgb == vec3(0.0)) {
    return;
  }
#endif
  vec3 N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  Gatherer at = Gatherer(position.xyz, N, true);
  vec2 place = (vec2(pixel) - pc_offset) / pc_stride;
  ivec2 lower = ivec2(floor(place));
  vec2 part = place - vec2(lower);
  ivec2 last = textureSize(light_tx, 0) - 1;
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    ivec2 from = clamp(lower + corner, ivec2(0), last);
    Gatherer other = surface_unpack(texelFetch(surface_tx, from, 0));
    if (!other.exists) {
      continue;
    }
    vec2 near = mix(1.0 - part, part, vec2(corner)) + 0.01;
    float weight = near.x * near.y * (surface_alike(at, other) + UPSAMPLE_LEAST);
    sum += weight * texelFetch(light_tx, from, 0).rgb;
    weights += weight;
  }
  vec3 light = weights > 0.0 ? pc_gain * sum / weights : vec3(0.0);
#ifdef GLOSSY
  light *= bxdf_albedo(specular.rgb, specular.a, dot(N, math_toward(position.xyz, pc_eye)));
#endif
  out_light = vec4(light, 1.0);
}
