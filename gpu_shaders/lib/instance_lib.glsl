/* Placing a mesh's corner in the world. */

/* The normal's transform is the cofactor matrix: right for non-uniform and for mirroring scale, no inverse needed. */
vec3 instance_normal(mat4 world_from_object, vec3 normal)
{
  vec3 x = world_from_object[0].xyz;
  vec3 y = world_from_object[1].xyz;
  vec3 z = world_from_object[2].xyz;
  vec3 n = normal.x * cross(y, z) + normal.y * cross(z, x) + normal.z * cross(x, y);
  return dot(x, cross(y, z)) < 0.0 ? -n : n;
}
