/* Unit vectors on the octahedron (Cigolle et al., "A Survey of Efficient Representations for Independent Unit
 * Vectors", JCGT 3(2), 2014): two numbers in [-1, 1]. */

vec2 octahedron_sign(vec2 v)
{
  return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

vec2 octahedron_encode(vec3 n)
{
  vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
  return n.z >= 0.0 ? p : (1.0 - abs(p.yx)) * octahedron_sign(p);
}

vec3 octahedron_decode(vec2 p)
{
  vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (n.z < 0.0) {
    n.xy = (1.0 - abs(n.yx)) * octahedron_sign(n.xy);
  }
  return normalize(n);
}
