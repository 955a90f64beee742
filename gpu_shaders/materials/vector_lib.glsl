/* What the Vector Math, Mapping, Vector Rotate and Map Range nodes do with vectors. */
#include "materials/number_lib.glsl"

vec3 vector_divide(vec3 a, vec3 b)
{
  return vec3(number_divide(a.x, b.x), number_divide(a.y, b.y), number_divide(a.z, b.z));
}

vec3 vector_modulo(vec3 a, vec3 b)
{
  return vec3(number_modulo(a.x, b.x), number_modulo(a.y, b.y), number_modulo(a.z, b.z));
}

vec3 vector_wrap(vec3 a, vec3 high, vec3 low)
{
  return vec3(number_wrap(a.x, high.x, low.x), number_wrap(a.y, high.y, low.y), number_wrap(a.z, high.z, low.z));
}

vec3 vector_power(vec3 a, vec3 b)
{
  return vec3(number_power(a.x, b.x), number_power(a.y, b.y), number_power(a.z, b.z));
}

vec3 vector_normalize(vec3 a)
{
  float size = length(a);
  return size != 0.0 ? a / size : vec3(0.0);
}

vec3 vector_project(vec3 a, vec3 b)
{
  float size = dot(b, b);
  return size != 0.0 ? b * (dot(a, b) / size) : vec3(0.0);
}

vec3 vector_reflect(vec3 a, vec3 b)
{
  return reflect(a, vector_normalize(b));
}

vec3 vector_clamp_range(vec3 v, vec3 a, vec3 b)
{
  return clamp(v, min(a, b), max(a, b));
}

vec3 vector_stepped(vec3 t, vec3 steps)
{
  return vec3(number_stepped(t.x, steps.x), number_stepped(t.y, steps.y), number_stepped(t.z, steps.z));
}

vec3 vector_smoothstep(vec3 t)
{
  return vec3(number_smoothstep(t.x), number_smoothstep(t.y), number_smoothstep(t.z));
}

vec3 vector_smootherstep(vec3 t)
{
  return vec3(number_smootherstep(t.x), number_smootherstep(t.y), number_smootherstep(t.z));
}

/* Rotations about x, then y, then z. */
mat3 vector_euler(vec3 angles)
{
  vec3 c = cos(angles), s = sin(angles);
  mat3 about_x = mat3(1.0, 0.0, 0.0, 0.0, c.x, s.x, 0.0, -s.x, c.x);
  mat3 about_y = mat3(c.y, 0.0, -s.y, 0.0, 1.0, 0.0, s.y, 0.0, c.y);
  mat3 about_z = mat3(c.z, s.z, 0.0, -s.z, c.z, 0.0, 0.0, 0.0, 1.0);
  return about_z * about_y * about_x;
}

vec3 vector_rotate_euler(vec3 v, vec3 center, vec3 angles, bool invert)
{
  mat3 rotation = vector_euler(angles);
  return (invert ? transpose(rotation) : rotation) * (v - center) + center;
}

/* About an axis through `center` (Rodrigues). */
vec3 vector_rotate(vec3 v, vec3 center, vec3 axis, float angle)
{
  float size = length(axis);
  if (size == 0.0) {
    return v;
  }
  axis /= size;
  v -= center;
  return v * cos(angle) + cross(axis, v) * sin(angle) + axis * dot(axis, v) * (1.0 - cos(angle)) + center;
}

vec3 vector_mapping_point(vec3 v, vec3 location, vec3 rotation, vec3 scale)
{
  return vector_euler(rotation) * (v * scale) + location;
}

vec3 vector_mapping_texture(vec3 v, vec3 location, vec3 rotation, vec3 scale)
{
  return vector_divide(transpose(vector_euler(rotation)) * (v - location), scale);
}

vec3 vector_mapping_vector(vec3 v, vec3 rotation, vec3 scale)
{
  return vector_euler(rotation) * (v * scale);
}

vec3 vector_mapping_normal(vec3 v, vec3 rotation, vec3 scale)
{
  return vector_normalize(vector_euler(rotation) * vector_divide(v, scale));
}

/* A normal by the matrix that takes points there: it stays perpendicular. */
vec3 vector_transform_normal(vec3 normal, mat4 matrix)
{
  return vector_normalize(transpose(inverse(mat3(matrix))) * normal);
}

/* Directions around an axis through the middle of an object, at a place from there: a Tangent node's. */
vec3 vector_around_x(vec3 p)
{
  return vec3(0.0, -p.z, p.y);
}

vec3 vector_around_y(vec3 p)
{
  return vec3(-p.z, 0.0, p.x);
}

vec3 vector_around_z(vec3 p)
{
  return vec3(-p.y, p.x, 0.0);
}
