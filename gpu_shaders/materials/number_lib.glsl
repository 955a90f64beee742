/* What the Math and Map Range nodes do where GLSL's own function is undefined or another. */

const float NUMBER_LEAST = 1.192092896e-7;

float number_divide(float a, float b)
{
  return b != 0.0 ? a / b : 0.0;
}

/* Negative numbers to whole powers only; the rest is 0. */
float number_power(float a, float b)
{
  if (b == 0.0) {
    return 1.0;
  }
  if (a > 0.0) {
    return pow(a, b);
  }
  if (a == 0.0 || b != trunc(b)) {
    return 0.0;
  }
  float size = pow(-a, b);
  return mod(b, 2.0) == 0.0 ? size : -size;
}

float number_logarithm(float a, float base)
{
  return a > 0.0 && base > 0.0 ? number_divide(log(a), log(base)) : 0.0;
}

float number_inverse_root(float a)
{
  return a > 0.0 ? inversesqrt(a) : 0.0;
}

/* The remainder with the dividend's sign. */
float number_modulo(float a, float b)
{
  if (b == 0.0) {
    return 0.0;
  }
  float rest = abs(a) - abs(b) * trunc(abs(a) / abs(b));
  return a < 0.0 ? -rest : rest;
}

/* The remainder from 0 to b. */
float number_floored_modulo(float a, float b)
{
  return b != 0.0 ? a - floor(a / b) * b : 0.0;
}

float number_wrap(float a, float high, float low)
{
  float range = high - low;
  return range != 0.0 ? a - range * floor((a - low) / range) : low;
}

float number_pingpong(float a, float scale)
{
  return scale != 0.0 ? abs(fract((a - scale) / (scale * 2.0)) * scale * 2.0 - scale) : 0.0;
}

float number_compare(float a, float b, float within)
{
  return float(abs(a - b) <= max(within, NUMBER_LEAST));
}

/* The lesser of two, rounded off by a cubic where they are within `reach` of one another. */
float number_smooth_minimum(float a, float b, float reach)
{
  if (reach == 0.0) {
    return min(a, b);
  }
  float h = max(reach - abs(a - b), 0.0) / reach;
  return min(a, b) - h * h * h * reach / 6.0;
}

float number_clamp_range(float value, float a, float b)
{
  return a > b ? clamp(value, b, a) : min(max(value, a), b);
}

/* The angle of (b, a), 0 at the origin. */
float number_arctan2(float a, float b)
{
  return a == 0.0 && b == 0.0 ? 0.0 : atan(a, b);
}

/* Where a value lies between two, 0 to 1, and how the interpolations change it. */
float number_place(float value, float low, float high)
{
  return number_divide(value - low, high - low);
}

float number_stepped(float t, float steps)
{
  return steps > 0.0 ? floor(t * (steps + 1.0)) / steps : 0.0;
}

float number_smoothstep(float t)
{
  t = clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

float number_smootherstep(float t)
{
  t = clamp(t, 0.0, 1.0);
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}
