/* The surface that a pixel of a baked object shows, and what is written of it: however vertices' light is mixed. */
#include "lib/bxdf_lib.glsl"
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"

struct PrtSurface {
  vec3 N;
  vec3 V;        /* to the eye */
  vec4 specular; /* as the G-buffer has it */
  float cosine;  /* of N to V */
  bool reflects;
};

PrtSurface prt_surface()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  PrtSurface surface;
  surface.N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  surface.V = math_toward(v_position, prt_draw.eye);
  surface.specular = texelFetch(specular_tx, pixel, 0);
  surface.cosine = clamp(dot(surface.N, surface.V), 0.0, 1.0);
  surface.reflects = surface.specular.rgb != vec3(0.0);
  return surface;
}

/* `irradiance` is over pi, `radiance` what the whole lobe would mirror of a white surface. */
void prt_write(PrtSurface surface, vec3 irradiance, vec3 radiance)
{
  out_position = vec4(v_position, 1.0 + float(prt_draw.has));
  out_diffuse = vec4(max(irradiance, vec3(0.0)), 1.0);
  vec3 part = surface.reflects ? bxdf_albedo(surface.specular.rgb, surface.specular.a, surface.cosine) : vec3(0.0);
  out_glossy = vec4(part * max(radiance, vec3(0.0)), 1.0);
}
