/* What several libraries need. */

const float MATH_PI = 3.14159265358979;

/* Unit direction from P to `place`: a point where w is 1, a direction where w is 0. */
vec3 math_toward(vec3 P, vec4 place)
{
  return place.w > 0.5 ? normalize(place.xyz - P) : place.xyz;
}

/* How far P is from `eye`, a point where w is 1, a direction to it where w is 0: larger is farther off. */
float math_depth(vec3 P, vec4 eye)
{
  return eye.w > 0.5 ? distance(P, eye.xyz) : -dot(P, eye.xyz);
}
