/* The radiance that arrives, as spherical harmonics between the vertices (Sloan, Kautz, Snyder 2002): convolved with the
 * cosine around the normal, and as a table over roughness and view says that the material is seen (Kautz, Sloan,
 * Snyder 2002). */
#include "lib/sh_lib.glsl"
#include "prt/prt_rows_lib.glsl"
#include "prt/prt_surface_lib.glsl"

/* The cosine lobe over pi, a factor a band (Ramamoorthi & Hanrahan 2001). */
const float PRT_COSINE[6] = float[6](1.0, 0.66666667, 0.25, 0.0, -0.041666667, 0.0);

/* The table of bake/view_table.py at a roughness and view: a weight for each direction and band from 1 on. */
void prt_weights(float roughness, float cosine, out vec4 weights[PRT_TEXELS])
{
  vec2 place = clamp(vec2(roughness, sqrt(1.0 - cosine)), 0.0, 1.0) * float(PRT_LOBES - 1);
  ivec2 lower = min(ivec2(place), ivec2(PRT_LOBES - 2));
  vec2 part = place - vec2(lower);
  for (int i = 0; i < PRT_TEXELS; i++) {
    weights[i] = vec4(0.0);
  }
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    vec2 near = mix(1.0 - part, part, vec2(corner));
    ivec2 texel = (lower + corner) * ivec2(PRT_TEXELS, 1);
    for (int j = 0; j < PRT_TEXELS; j++) {
      weights[j] += near.x * near.y * texelFetch(lobe_tx, texel + ivec2(j, 0), 0);
    }
  }
}

/* What the harmonics of the arriving radiance are multiplied with to be what is seen, along the bake's axes. No lobe is
 * narrower than what their bands hold (least_roughness() in bake/view_table.py). */
void prt_seen(PrtSurface surface, mat3 local, out float seen[SH_MOST])
{
  vec3 across = surface.cosine * surface.N - surface.V; /* away from the view, along the surface */
  float size = length(across);
  across = size > 1e-6 ? across / size : vec3(0.0);
  vec4 weights[PRT_TEXELS];
  prt_weights(max(surface.specular.a, prt_draw.least_roughness), surface.cosine, weights);
  for (int i = 0; i < SH_MOST; i++) {
    seen[i] = 0.0;
  }
  float at[SH_MOST];
  for (int k = 0; k < PRT_BANDS; k++) {
    float angle = (float(k) + 0.5) * (MATH_PI / float(PRT_BANDS));
    sh_evaluate(local * (sin(angle) * across + cos(angle) * surface.N), at);
    int i = 1;
    for (int order = 1; order * order < prt_draw.coefficients; order++) {
      int number = k * (PRT_BANDS - 1) + order - 1;
      float weight = weights[number / 4][number % 4];
      for (; i < (order + 1) * (order + 1); i++) {
        seen[i] += weight * at[i];
      }
    }
  }
  seen[0] = at[0];
}

void main()
{
  PrtSurface surface = prt_surface();
  mat3 local = mat3(prt_draw.local_from_world);
  float at_normal[SH_MOST];
  float seen[SH_MOST];
  sh_evaluate(local * surface.N, at_normal);
  if (surface.reflects) {
    prt_seen(surface, local, seen);
  }

  ivec3 rows;
  vec3 weights;
  prt_find(rows, weights);
  /* Three numbers a coefficient, one after another in texels of four. */
  vec3 irradiance = vec3(0.0);
  vec3 radiance = vec3(0.0);
  vec4 numbers = vec4(0.0);
  int read = -1;
  int order = 0;
  for (int i = 0; i < prt_draw.coefficients; i++) {
    vec3 value;
    for (int c = 0; c < 3; c++) {
      int number = 3 * i + c;
      if (number / 4 != read) {
        read = number / 4;
        numbers = mat3x4(prt_number(rows.x, read), prt_number(rows.y, read), prt_number(rows.z, read)) * weights;
      }
      value[c] = numbers[number % 4];
    }
    order += i == (order + 1) * (order + 1) ? 1 : 0;
    irradiance += value * (at_normal[i] * PRT_COSINE[order]);
    radiance += surface.reflects ? value * seen[i] : vec3(0.0);
  }
  prt_write(surface, irradiance, radiance);
}
