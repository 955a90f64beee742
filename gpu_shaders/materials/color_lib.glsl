/* Colour spaces, the blend modes of Mix, and what the colour nodes do. Linear Rec. 709. */
#include "materials/number_lib.glsl"

float color_gray(vec3 c)
{
  return dot(c, vec3(0.2126729, 0.7151522, 0.0721750));
}

/* Where a colour's hue lies around the circle, 0 to 1, of its greatest part and its range. */
float color_hue(vec3 c, float most, float range)
{
  if (range == 0.0) {
    return 0.0;
  }
  vec3 d = (most - c) / range;
  float sixth = c.r == most ? d.b - d.g : c.g == most ? 2.0 + d.r - d.b : 4.0 + d.g - d.r;
  return fract(sixth / 6.0);
}

/* Pure hue: red at 0, green at 1/3, blue at 2/3. */
vec3 color_of_hue(float hue)
{
  return clamp(abs(fract(hue + vec3(1.0, 2.0 / 3.0, 1.0 / 3.0)) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
}

vec3 color_hsv_from_rgb(vec3 c)
{
  float most = max(c.r, max(c.g, c.b)), range = most - min(c.r, min(c.g, c.b));
  float saturation = most != 0.0 ? range / most : 0.0;
  return vec3(saturation != 0.0 ? color_hue(c, most, range) : 0.0, saturation, most);
}

vec3 color_rgb_from_hsv(vec3 hsv)
{
  return hsv.z * mix(vec3(1.0), color_of_hue(hsv.x), hsv.y);
}

vec3 color_hsl_from_rgb(vec3 c)
{
  float most = max(c.r, max(c.g, c.b)), least = min(c.r, min(c.g, c.b)), range = most - least;
  float light = min(0.5 * (most + least), 1.0);
  float saturation = range == 0.0 ? 0.0 : light > 0.5 ? range / (2.0 - most - least) : range / (most + least);
  return vec3(color_hue(c, most, range), saturation, light);
}

vec3 color_rgb_from_hsl(vec3 hsl)
{
  float chroma = (1.0 - abs(2.0 * hsl.z - 1.0)) * hsl.y;
  return (color_of_hue(hsl.x) - 0.5) * chroma + hsl.z;
}

vec3 color_adjust_hsv(vec3 c, float hue, float saturation, float value, float factor)
{
  vec3 hsv = color_hsv_from_rgb(c);
  hsv = vec3(fract(hsv.x + hue + 0.5), clamp(hsv.y * saturation, 0.0, 1.0), hsv.z * value);
  return max(mix(c, color_rgb_from_hsv(hsv), factor), 0.0);
}

vec3 color_gamma(vec3 c, float gamma)
{
  if (gamma == 0.0) {
    return vec3(1.0);
  }
  return mix(c, pow(max(c, 1e-30), vec3(gamma)), greaterThan(c, vec3(0.0)));
}

vec3 color_bright_contrast(vec3 c, float bright, float contrast)
{
  return max((1.0 + contrast) * c + bright - 0.5 * contrast, 0.0);
}

/* The colour of a black body of so many kelvin, its luminance 1: polynomials in 1000 / T fitted to what Cycles shows
 * between 800 K and 12000 K, where it ends. The greatest channels' errors are 1e-3 of them. */
vec3 color_blackbody(float kelvin)
{
  float T = clamp(kelvin, 800.0, 12000.0), x = 1000.0 / T;
  float r = 0.677350412 +
            x * (0.808709084 +
                 x * (13.9671945 +
                      x * (-29.8926653 + x * (40.5822466 + x * (-34.659396 + x * (16.333184 - x * 3.2146287))))));
  float g = 0.954654972 + x * (0.885973944 + x * (-5.48587651 + x * (6.77525272 + x * (-4.1535618 + x * 1.06242785))));
  float b =
      2.27544409 +
      x * (-7.8448523 + x * (-20.189279 + x * (184.614249 + x * (-495.379469 + x * (620.763047 - x * 307.158286)))));
  return max(vec3(r, T < 965.0 ? 0.0 : g, T < 1905.0 ? 0.0 : b), 0.0);
}

/* Blend modes: a below, b above, t of b. */
vec3 color_mix_mix(vec3 a, vec3 b, float t)
{
  return mix(a, b, t);
}

vec3 color_mix_darken(vec3 a, vec3 b, float t)
{
  return mix(a, min(a, b), t);
}

vec3 color_mix_multiply(vec3 a, vec3 b, float t)
{
  return mix(a, a * b, t);
}

vec3 color_mix_burn(vec3 a, vec3 b, float t)
{
  vec3 over = 1.0 - t + t * b;
  return mix(vec3(0.0), clamp(1.0 - (1.0 - a) / over, 0.0, 1.0), greaterThan(over, vec3(0.0)));
}

vec3 color_mix_lighten(vec3 a, vec3 b, float t)
{
  return mix(a, max(a, b), t);
}

vec3 color_mix_screen(vec3 a, vec3 b, float t)
{
  return 1.0 - (1.0 - t + t * (1.0 - b)) * (1.0 - a);
}

float color_dodge_one(float a, float b, float t)
{
  float over = 1.0 - t * b;
  return a == 0.0 ? 0.0 : over <= 0.0 ? 1.0 : min(a / over, 1.0);
}

vec3 color_mix_dodge(vec3 a, vec3 b, float t)
{
  return vec3(color_dodge_one(a.r, b.r, t), color_dodge_one(a.g, b.g, t), color_dodge_one(a.b, b.b, t));
}

vec3 color_mix_add(vec3 a, vec3 b, float t)
{
  return a + t * b;
}

vec3 color_mix_overlay(vec3 a, vec3 b, float t)
{
  vec3 dark = a * (1.0 - t + 2.0 * t * b);
  vec3 light = 1.0 - (1.0 - t + 2.0 * t * (1.0 - b)) * (1.0 - a);
  return mix(light, dark, lessThan(a, vec3(0.5)));
}

vec3 color_mix_soft_light(vec3 a, vec3 b, float t)
{
  vec3 screen = 1.0 - (1.0 - b) * (1.0 - a);
  return (1.0 - t) * a + t * ((1.0 - a) * b * a + a * screen);
}

vec3 color_mix_linear_light(vec3 a, vec3 b, float t)
{
  return a + t * (2.0 * b - 1.0);
}

vec3 color_mix_difference(vec3 a, vec3 b, float t)
{
  return mix(a, abs(a - b), t);
}

vec3 color_mix_exclusion(vec3 a, vec3 b, float t)
{
  return max(mix(a, a + b - 2.0 * a * b, t), 0.0);
}

vec3 color_mix_subtract(vec3 a, vec3 b, float t)
{
  return a - t * b;
}

float color_divide_one(float a, float b, float t)
{
  return b != 0.0 ? mix(a, a / b, t) : a;
}

vec3 color_mix_divide(vec3 a, vec3 b, float t)
{
  return vec3(color_divide_one(a.r, b.r, t), color_divide_one(a.g, b.g, t), color_divide_one(a.b, b.b, t));
}

vec3 color_mix_hue(vec3 a, vec3 b, float t)
{
  vec3 above = color_hsv_from_rgb(b);
  return above.y == 0.0 ? a : mix(a, color_rgb_from_hsv(vec3(above.x, color_hsv_from_rgb(a).yz)), t);
}

vec3 color_mix_saturation(vec3 a, vec3 b, float t)
{
  vec3 below = color_hsv_from_rgb(a);
  below.y = mix(below.y, color_hsv_from_rgb(b).y, t);
  return below.y == 0.0 ? a : color_rgb_from_hsv(below);
}

vec3 color_mix_color(vec3 a, vec3 b, float t)
{
  vec3 above = color_hsv_from_rgb(b);
  return above.y == 0.0 ? a : mix(a, color_rgb_from_hsv(vec3(above.xy, color_hsv_from_rgb(a).z)), t);
}

vec3 color_mix_value(vec3 a, vec3 b, float t)
{
  vec3 below = color_hsv_from_rgb(a);
  return color_rgb_from_hsv(vec3(below.xy, mix(below.z, color_hsv_from_rgb(b).z, t)));
}
