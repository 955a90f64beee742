/* Image and Environment Texture: projections, filters and what lies beyond the image's edges. `filtering`: linear (0),
 * closest (1), cubic (2); `extension`: repeat (0), extend (1), clip (2), mirror (3); `alpha`: data (0), whose colour is
 * not alpha's; colours that come out times alpha (1) or without it (2), filtered times alpha both, so that what is
 * transparent has no say. `place` is where in its texture an image lies: lower left texel and size. */

const float TEXTURE_PI = 3.14159265358979;

ivec4 texture_whole(sampler2D image_tx)
{
  return ivec4(ivec2(0), textureSize(image_tx, 0));
}

/* A texel, wherever it lies; clipped ones are transparent black. */
vec4 texture_texel(sampler2D image_tx, ivec4 place, ivec2 at, int extension, int alpha)
{
  ivec2 size = place.zw;
  ivec2 inside = clamp(at, ivec2(0), size - 1);
  if (extension == 2 && inside != at) {
    return vec4(0.0);
  }
  if (extension == 0) {
    inside = at - size * ivec2(floor(vec2(at) / vec2(size)));
  }
  if (extension == 3) {
    ivec2 twice = at - 2 * size * ivec2(floor(vec2(at) / vec2(2 * size)));
    inside = min(twice, 2 * size - 1 - twice);
  }
  vec4 texel = texelFetch(image_tx, place.xy + clamp(inside, ivec2(0), size - 1), 0);
  return alpha == 0 ? texel : vec4(texel.rgb * texel.a, texel.a);
}

/* Weights of a cubic B-spline for four texels in a row. */
vec4 texture_cubic(float t)
{
  float s = 1.0 - t;
  return vec4(s * s * s, 3.0 * t * t * (t - 2.0) + 4.0, 3.0 * s * s * (s - 2.0) + 4.0, t * t * t) / 6.0;
}

vec4 texture_filtered(sampler2D image_tx, ivec4 place, vec2 uv, int filtering, int extension, int alpha)
{
  if (extension == 0) {
    uv = fract(uv);
  }
  vec2 at = clamp(uv, vec2(-1e4), vec2(1e4)) * vec2(place.zw);
  if (filtering == 1) {
    return texture_texel(image_tx, place, ivec2(floor(at)), extension, alpha);
  }
  at -= 0.5;
  ivec2 lower = ivec2(floor(at));
  vec2 part = at - floor(at);
  vec4 sum = vec4(0.0);
  if (filtering == 0) {
    for (int k = 0; k < 4; k++) {
      ivec2 corner = ivec2(k & 1, k >> 1);
      vec2 share = mix(1.0 - part, part, vec2(corner));
      sum += share.x * share.y * texture_texel(image_tx, place, lower + corner, extension, alpha);
    }
    return sum;
  }
  vec4 across = texture_cubic(part.x), up = texture_cubic(part.y);
  for (int k = 0; k < 16; k++) {
    ivec2 corner = ivec2(k & 3, k >> 2);
    sum += across[corner.x] * up[corner.y] * texture_texel(image_tx, place, lower + corner - 1, extension, alpha);
  }
  return sum;
}

/* Linear values of sRGB ones. */
vec3 texture_decoded(vec3 c)
{
  c = max(c, vec3(0.0));
  return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, vec3(lessThan(c, vec3(0.04045))));
}

vec4 texture_in(sampler2D image_tx, ivec4 place, vec2 uv, int filtering, int extension, int alpha, bool is_srgb)
{
  vec4 value = texture_filtered(image_tx, place, uv, filtering, extension, alpha);
  if (alpha == 2 && value.a != 0.0) {
    value.rgb /= value.a;
  }
  return is_srgb ? vec4(texture_decoded(value.rgb), value.a) : value;
}

vec4 texture_sample(sampler2D image_tx, vec2 uv, int filtering, int extension, int alpha, bool is_srgb)
{
  return texture_in(image_tx, texture_whole(image_tx), uv, filtering, extension, alpha, is_srgb);
}

/* From the unit cube: around its middle as a ball, and around its upright axis. */
vec2 texture_sphere(vec3 p)
{
  p = p * 2.0 - 1.0;
  float size = length(p);
  if (size == 0.0) {
    return vec2(0.0);
  }
  float turn = p.x == 0.0 && p.y == 0.0 ? 0.0 : (1.0 - atan(p.x, p.y) / TEXTURE_PI) / 2.0;
  return vec2(turn, 1.0 - acos(clamp(p.z / size, -1.0, 1.0)) / TEXTURE_PI);
}

vec2 texture_tube(vec3 p)
{
  p = p * 2.0 - 1.0;
  if (p.x == 0.0 && p.y == 0.0) {
    return vec2(0.0);
  }
  return vec2((1.0 - atan(p.x, p.y) / TEXTURE_PI) / 2.0, (p.z + 1.0) / 2.0);
}

/* A direction on a panorama, and in the picture of a mirroring ball. */
vec2 texture_equirectangular(vec3 d)
{
  if (d == vec3(0.0)) {
    return vec2(0.0);
  }
  float turn = d.x == 0.0 && d.y == 0.0 ? 0.0 : atan(d.y, d.x);
  return vec2(0.5 - turn / (2.0 * TEXTURE_PI), 0.5 + atan(d.z, length(d.xy)) / TEXTURE_PI);
}

vec2 texture_mirror_ball(vec3 d)
{
  d = normalize(d);
  float size = 2.0 * sqrt(max(0.5 - 0.5 * d.y, 0.0));
  return size > 0.0 ? 0.5 + 0.5 * d.xz / size : vec2(0.5);
}

/* How much each side of a box counts for a normal: one, two near an edge, three near a corner, as `blend` widens. */
vec3 texture_box_shares(vec3 normal, float blend)
{
  vec3 n = abs(normal);
  n /= max(n.x + n.y + n.z, 1e-20);
  float limit = 0.5 * (1.0 + blend);
  /* The others' sums, and the pairs that a side is left out of. */
  for (int k = 0; k < 3; k++) {
    float a = n[(k + 1) % 3], b = n[(k + 2) % 3];
    if (n[k] > limit * (n[k] + a) && n[k] > limit * (n[k] + b)) {
      vec3 one = vec3(0.0);
      one[k] = 1.0;
      return one;
    }
  }
  if (blend <= 0.0) {
    return vec3(1.0, 0.0, 0.0);
  }
  for (int j = 2; j < 5; j++) {
    int k = j % 3, i = k == 0 ? 1 : 0, h = k == 2 ? 1 : 2;
    if (n[k] < (1.0 - limit) * (n[i] + n[h])) {
      vec3 two = vec3(0.0);
      two[i] = clamp((n[i] / (n[i] + n[h]) - 0.5 * (1.0 - blend)) / blend, 0.0, 1.0);
      two[h] = 1.0 - two[i];
      return two;
    }
  }
  return ((2.0 - limit) * n + (limit - 1.0)) / (2.0 * limit - 1.0);
}

/* Three planar projections, mirrored so that none is seen from behind. */
vec4 texture_box(sampler2D image_tx, ivec4 place, vec3 p, vec3 normal, float blend, int filtering, int extension,
                 int alpha, bool is_srgb)
{
  vec3 share = texture_box_shares(normal, blend);
  vec4 sum = vec4(0.0);
  vec2 x = vec2(normal.x < 0.0 ? 1.0 - p.y : p.y, p.z);
  vec2 y = vec2(normal.y > 0.0 ? 1.0 - p.x : p.x, p.z);
  vec2 z = vec2(normal.z > 0.0 ? 1.0 - p.y : p.y, p.x);
  sum += share.x > 0.0 ? share.x * texture_in(image_tx, place, x, filtering, extension, alpha, is_srgb) : vec4(0.0);
  sum += share.y > 0.0 ? share.y * texture_in(image_tx, place, y, filtering, extension, alpha, is_srgb) : vec4(0.0);
  sum += share.z > 0.0 ? share.z * texture_in(image_tx, place, z, filtering, extension, alpha, is_srgb) : vec4(0.0);
  return sum;
}
