/* What a vertex reflects as a sum of products (Wang, Tran, Luebke 2004): the numbers that its light gave, each times a
 * function of the view along the vertex' own normal and tangent. Each corner is seen for itself, then they are mixed:
 * twin of Separable.of_view() in bake/separable.py. */
#include "prt/prt_rows_lib.glsl"
#include "prt/prt_surface_lib.glsl"

vec3 prt_mirrored(int vertex, vec3 V)
{
  int terms = prt_draw.coefficients - 3;
  vec3 normal = prt_number(vertex, terms + 1).xyz;
  vec3 tangent = prt_number(vertex, terms + 2).xyz;
  vec2 turn = vec2(dot(V, tangent), dot(V, cross(normal, tangent)));
  float size = length(turn);
  turn = size > 1e-6 ? turn / size : vec2(1.0, 0.0);

  float place = sqrt(1.0 - clamp(dot(V, normal), 0.0, 1.0)) * float(PRT_VIEWS - 1);
  int lower = min(int(place), PRT_VIEWS - 2);
  float part = place - float(lower);
  vec3 sum = vec3(0.0);
  vec2 power = vec2(1.0, 0.0); /* cosine and sine of so many times the azimuth; terms come by rising order */
  int order = 0;
  for (int k = 0; k < terms; k++) {
    vec4 term = texelFetch(lobe_tx, ivec2(k, lower), 0);
    float value = mix(term.x, texelFetch(lobe_tx, ivec2(k, lower + 1), 0).x, part);
    for (; order < int(term.y); order++) {
      power = vec2(power.x * turn.x - power.y * turn.y, power.x * turn.y + power.y * turn.x);
    }
    sum += value * (term.z > 0.5 ? power.y : power.x) * prt_number(vertex, k + 1).rgb;
  }
  return sum;
}

void main()
{
  PrtSurface surface = prt_surface();
  vec3 local = mat3(prt_draw.local_from_world) * surface.V;
  ivec3 rows;
  vec3 weights;
  prt_find(rows, weights);
  vec3 irradiance = vec3(0.0);
  vec3 radiance = vec3(0.0);
  for (int corner = 0; corner < 3; corner++) {
    irradiance += weights[corner] * prt_number(rows[corner], 0).rgb;
    radiance += surface.reflects ? weights[corner] * prt_mirrored(rows[corner], local) : vec3(0.0);
  }
  prt_write(surface, irradiance, radiance);
}
