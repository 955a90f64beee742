/* Normal Map and Bump. Their frames are made from screen derivatives, so they need a fragment shader; where a program's
 * neighbouring fragments are not neighbours on the surface (MATERIAL_SCATTERED) they leave the normal alone. */

/* The axes along which a UV map grows on a surface, unit, in the surface's plane. */
void relief_frame(vec3 normal, vec3 P, vec2 uv, out vec3 tangent, out vec3 bitangent)
{
  vec3 across = cross(dFdy(P), normal), along = cross(normal, dFdx(P));
  vec2 du = dFdx(uv), dv = dFdy(uv);
  tangent = across * du.x + along * dv.x;
  bitangent = across * du.y + along * dv.y;
  float sign_of_area = dot(dFdx(P), across) < 0.0 ? -1.0 : 1.0;
  tangent *= sign_of_area / max(length(tangent), 1e-20);
  bitangent *= sign_of_area / max(length(bitangent), 1e-20);
}

vec3 relief_toward(vec3 normal, vec3 wanted)
{
  float size = length(wanted);
  return size > 0.0 ? wanted / size : normal;
}

/* A tangent-space map's colour; `strength` flattens or exaggerates it. */
vec3 relief_tangent_map(vec3 color, float strength, vec3 normal, vec3 P, vec2 uv)
{
#ifdef MATERIAL_SCATTERED
  return normal;
#endif
  vec3 tangent, bitangent;
  relief_frame(normal, P, uv, tangent, bitangent);
  vec3 n = 2.0 * color - 1.0;
  n = vec3(n.xy * max(strength, 0.0), mix(1.0, n.z, clamp(strength, 0.0, 1.0)));
  return relief_toward(normal, n.x * tangent + n.y * bitangent + n.z * normal);
}

/* A map in another space, its normal already in the world. */
vec3 relief_mixed(vec3 mapped, float strength, vec3 normal)
{
  mapped = relief_toward(normal, mapped);
  return relief_toward(normal, normal + (mapped - normal) * max(strength, 0.0));
}

/* The normal of a surface raised by `height` (Mikkelsen 2010). */
vec3 relief_bump(float height, float strength, float distance, vec3 normal, vec3 P)
{
#ifdef MATERIAL_SCATTERED
  return normal;
#endif
  vec3 dx = dFdx(P), dy = dFdy(P);
  vec3 across = cross(dy, normal), along = cross(normal, dx);
  float area = dot(dx, across);
  vec3 slope = dFdx(height) * across + dFdy(height) * along;
  vec3 raised = abs(area) * normal - distance * (area < 0.0 ? -1.0 : 1.0) * slope;
  return relief_toward(normal, mix(normal, relief_toward(normal, raised), max(strength, 0.0)));
}
