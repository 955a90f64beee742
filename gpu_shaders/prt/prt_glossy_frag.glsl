/* The radiance that arrives, as spherical harmonics between the vertices (Sloan, Kautz, Snyder 2002): convolved with the
 * cosine around the normal, and with the material's lobe around the direction that the lobe has on average. */
#include "lib/bxdf_lib.glsl"
#include "lib/octahedron_lib.glsl"
#include "lib/sh_lib.glsl"

/* The cosine lobe over pi, a factor a band (Ramamoorthi & Hanrahan 2001). */
const float PRT_COSINE[6] = float[6](1.0, 0.66666667, 0.25, 0.0, -0.041666667, 0.0);

/* x: cosine of the lobe's mean direction to the normal, and factors of the bands 1 to 5. */
void prt_lobe(float roughness, float cosine, out float axis, out float bands[6])
{
  vec2 place = clamp(vec2(roughness, cosine), 0.0, 1.0) * float(PRT_LOBES - 1);
  ivec2 lower = min(ivec2(place), ivec2(PRT_LOBES - 2));
  vec2 part = place - vec2(lower);
  vec4 first = vec4(0.0);
  vec4 second = vec4(0.0);
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    vec2 near = mix(1.0 - part, part, vec2(corner));
    ivec2 texel = (lower + corner) * ivec2(2, 1);
    first += near.x * near.y * texelFetch(lobe_tx, texel, 0);
    second += near.x * near.y * texelFetch(lobe_tx, texel + ivec2(1, 0), 0);
  }
  axis = first.x;
  bands[0] = 1.0;
  bands[1] = first.y;
  bands[2] = first.z;
  bands[3] = first.w;
  bands[4] = second.x;
  bands[5] = second.y;
}

vec4 prt_mixed(int texel)
{
  vec4 sum = vec4(0.0);
  for (int corner = 0; corner < 3; corner++) {
    int vertex = v_triangle[corner];
    ivec2 first = ivec2(vertex % prt_draw.row * prt_draw.texels, vertex / prt_draw.row);
    sum += v_weights[corner] * texelFetch(light_tx, first + ivec2(texel, 0), 0);
  }
  return sum;
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_position = vec4(v_position, 1.0 + float(prt_draw.has));
  vec3 N = octahedron_decode(texelFetch(normal_tx, pixel, 0).xy);
  vec3 V = math_toward(v_position, prt_draw.eye);
  vec4 specular = texelFetch(specular_tx, pixel, 0);
  float cosine = clamp(dot(N, V), 0.0, 1.0);

  float axis;
  float lobe[6];
  prt_lobe(specular.a, cosine, axis, lobe);
  vec3 across = cosine * N - V; /* away from the view, along the surface */
  float size = length(across);
  vec3 mirrored = size > 1e-6 ? axis * N + sqrt(max(1.0 - axis * axis, 0.0)) / size * across : N;

  mat3 local = mat3(prt_draw.local_from_world);
  float at_normal[SH_MOST];
  float at_mirrored[SH_MOST];
  sh_evaluate(local * N, at_normal);
  sh_evaluate(local * mirrored, at_mirrored);

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
        numbers = prt_mixed(read);
      }
      value[c] = numbers[number % 4];
    }
    order += i == (order + 1) * (order + 1) ? 1 : 0;
    irradiance += value * (at_normal[i] * PRT_COSINE[order]);
    radiance += value * (at_mirrored[i] * lobe[order]);
  }
  out_diffuse = vec4(max(irradiance, vec3(0.0)), 1.0);
  vec3 reflects = specular.rgb == vec3(0.0) ? vec3(0.0) : bxdf_albedo(specular.rgb, specular.a, cosine);
  out_glossy = vec4(reflects * max(radiance, vec3(0.0)), 1.0);
}
