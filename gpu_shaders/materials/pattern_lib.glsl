/* The textures that are formulas: Wave, Gradient, Checker, Brick, Magic. */
#include "materials/noise_lib.glsl"

const float PATTERN_PI = 3.14159265358979;

/* Keeps whole coordinates, as of a unit cube's sides, off the steps that they would lie on. */
vec3 pattern_off_steps(vec3 p)
{
  return (p + 1e-6) * 0.999999;
}

float pattern_gradient_linear(vec3 p)
{
  return p.x;
}

float pattern_gradient_quadratic(vec3 p)
{
  float r = max(p.x, 0.0);
  return r * r;
}

float pattern_gradient_easing(vec3 p)
{
  float r = clamp(p.x, 0.0, 1.0);
  return r * r * (3.0 - 2.0 * r);
}

float pattern_gradient_diagonal(vec3 p)
{
  return 0.5 * (p.x + p.y);
}

float pattern_gradient_radial(vec3 p)
{
  return (p.x == 0.0 && p.y == 0.0 ? 0.0 : atan(p.y, p.x)) / (2.0 * PATTERN_PI) + 0.5;
}

float pattern_gradient_spherical(vec3 p)
{
  return max(0.999999 - length(p), 0.0);
}

float pattern_gradient_quadratic_sphere(vec3 p)
{
  float r = pattern_gradient_spherical(p);
  return r * r;
}

float pattern_checker(vec3 p, float scale)
{
  ivec3 cell = ivec3(floor(pattern_off_steps(p * scale)));
  return float(((cell.x + cell.y + cell.z) & 1) != 0);
}

/* A profile from 0 to 1 of a phase in radians. */
float pattern_wave_sin(float phase)
{
  return 0.5 + 0.5 * sin(phase - 0.5 * PATTERN_PI);
}

float pattern_wave_saw(float phase)
{
  return fract(phase / (2.0 * PATTERN_PI));
}

float pattern_wave_tri(float phase)
{
  float turns = phase / (2.0 * PATTERN_PI);
  return abs(turns - floor(turns + 0.5)) * 2.0;
}

/* Phase of waves along `axes` (bands), or of rings around what `axes` leave out. */
float pattern_wave_phase(vec3 p, vec3 axes, bool rings, float distortion, NoiseFractal fractal, float detail_scale,
                         float phase)
{
  p = pattern_off_steps(p);
  float n = 20.0 * (rings ? length(p * axes) : dot(p, axes)) + phase;
  if (distortion != 0.0) {
    n += distortion * (noise_fbm_normalized(vec4(p * detail_scale, 0.0), fractal) * 2.0 - 1.0);
  }
  return n;
}

struct PatternBrick {
  float tint;   /* the brick's own place between both colours */
  float mortar; /* how much of the mortar's */
};

/* A random number of 0..1, by the integer noise that Hugo Elias made known. */
float pattern_brick_random(int n)
{
  n = (n + 1013) & 0x7fffffff;
  n = (n >> 13) ^ n;
  n = (n * (n * n * 60493 + 19990303) + 1376312589) & 0x7fffffff;
  return float(n) / 2147483648.0;
}

/* Every so many rows (0: none) bricks are squashed, or moved by a part of their width. */
PatternBrick pattern_brick(vec3 p, float mortar, float smoothing, float bias, float width, float height, float offset,
                           int offset_every, float squash, int squash_every)
{
  int row = int(floor(p.y / height));
  float start = 0.0;
  if (offset_every != 0 && squash_every != 0) {
    width *= abs(row) % squash_every == 0 ? squash : 1.0;
    start = abs(row) % offset_every == 0 ? width * offset : 0.0;
  }
  int brick = int(floor((p.x + start) / width));
  vec2 at = vec2(p.x + start - width * float(brick), p.y - height * float(row));
  vec2 inside = min(at, vec2(width, height) - at);
  float edge = min(inside.x, inside.y);
  float tint = clamp(pattern_brick_random((row << 16) + (brick & 0xffff)) + bias, 0.0, 1.0);
  if (edge >= mortar) {
    return PatternBrick(tint, 0.0);
  }
  float depth = 1.0 - edge / mortar;
  return PatternBrick(tint, smoothing == 0.0 ? 1.0 : smoothstep(0.0, 1.0, depth / smoothing));
}

/* Sines of sums of sines, `depth` times. */
vec3 pattern_magic(vec3 p, int depth, float distortion)
{
  p = mod(p, 2.0 * PATTERN_PI);
  float x = sin((p.x + p.y + p.z) * 5.0), y = cos((-p.x + p.y - p.z) * 5.0), z = -cos((-p.x - p.y + p.z) * 5.0);
  if (depth > 0) {
    x *= distortion;
    y = -cos(x - y * distortion + z * distortion) * distortion;
    z *= distortion;
  }
  x = depth > 1 ? cos(x - y - z) * distortion : x;
  z = depth > 2 ? sin(-x - y - z) * distortion : z;
  x = depth > 3 ? -cos(-x + y - z) * distortion : x;
  y = depth > 4 ? -sin(-x + y + z) * distortion : y;
  y = depth > 5 ? -cos(-x + y + z) * distortion : y;
  x = depth > 6 ? cos(x + y + z) * distortion : x;
  z = depth > 7 ? sin(x + y - z) * distortion : z;
  x = depth > 8 ? -cos(-x - y + z) * distortion : x;
  y = depth > 9 ? -sin(x - y + z) * distortion : y;
  vec3 sines = distortion != 0.0 ? vec3(x, y, z) / (2.0 * distortion) : vec3(x, y, z);
  return 0.5 - sines;
}
