/* Hashes of numbers: Bob Jenkins' lookup3 (2006) of float bits, and PCG (Jarzynski & Olano 2020) of signed cells.
 * Cycles draws the randomness of its textures from these two. */

const float HASH_UINT_RANGE = 1.0 / 4294967295.0;
const float HASH_INT_RANGE = 1.0 / 2147483647.0;

uint hash_rotate(uint bits, int by)
{
  return (bits << by) | (bits >> (32 - by));
}

/* lookup3's end, of its state (a, b, c). */
uint hash_final(uvec3 s)
{
  s.z = (s.z ^ s.y) - hash_rotate(s.y, 14);
  s.x = (s.x ^ s.z) - hash_rotate(s.z, 11);
  s.y = (s.y ^ s.x) - hash_rotate(s.x, 25);
  s.z = (s.z ^ s.y) - hash_rotate(s.y, 16);
  s.x = (s.x ^ s.z) - hash_rotate(s.z, 4);
  s.y = (s.y ^ s.x) - hash_rotate(s.x, 14);
  return (s.z ^ s.y) - hash_rotate(s.y, 24);
}

/* lookup3 of one to four words: `count` of k. */
uint hash_words(uvec4 k, int count)
{
  uvec3 s = uvec3(0xdeadbeefu + (uint(count) << 2) + 13u);
  s.x += k.x;
  s.y += count > 1 ? k.y : 0u;
  s.z += count > 2 ? k.z : 0u;
  if (count > 3) {
    s.x = (s.x - s.z) ^ hash_rotate(s.z, 4);
    s.z += s.y;
    s.y = (s.y - s.x) ^ hash_rotate(s.x, 6);
    s.x += s.z;
    s.z = (s.z - s.y) ^ hash_rotate(s.y, 8);
    s.y += s.x;
    s.x = (s.x - s.z) ^ hash_rotate(s.z, 16);
    s.z += s.y;
    s.y = (s.y - s.x) ^ hash_rotate(s.x, 19);
    s.x += s.z;
    s.z = (s.z - s.y) ^ hash_rotate(s.y, 4);
    s.y += s.x;
    s.x += k.w;
  }
  return hash_final(s);
}

/* [0, 1] of the first `count` numbers of p. */
float hash_float(vec4 p, int count)
{
  return float(hash_words(floatBitsToUint(p), count)) * HASH_UINT_RANGE;
}

/* The random colour of a place of `count` coordinates. */
vec3 hash_color(vec4 p, int count)
{
  if (count == 1) {
    return vec3(hash_float(p, 1), hash_float(vec4(p.x, 1.0, 0.0, 0.0), 2), hash_float(vec4(p.x, 2.0, 0.0, 0.0), 2));
  }
  if (count == 2) {
    return vec3(hash_float(p, 2), hash_float(vec4(p.xy, 1.0, 0.0), 3), hash_float(vec4(p.xy, 2.0, 0.0), 3));
  }
  if (count == 3) {
    return vec3(hash_float(p, 3), hash_float(vec4(p.xyz, 1.0), 4), hash_float(vec4(p.xyz, 2.0), 4));
  }
  return vec3(hash_float(p, 4), hash_float(p.zxwy, 4), hash_float(p.wzyx, 4));
}

/* PCG in two, three and four dimensions; the shift keeps the sign, as that of int does. */
vec2 hash_cell_2(ivec2 cell)
{
  ivec2 v = cell * 1664525 + 1013904223;
  v.x += v.y * 1664525;
  v.y += v.x * 1664525;
  v = v ^ (v >> 16);
  v.x += v.y * 1664525;
  v.y += v.x * 1664525;
  return vec2(v & 0x7fffffff) * HASH_INT_RANGE;
}

vec3 hash_cell_3(ivec3 cell)
{
  ivec3 v = cell * 1664525 + 1013904223;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v = v ^ (v >> 16);
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return vec3(v & 0x7fffffff) * HASH_INT_RANGE;
}

vec4 hash_cell_4(ivec4 cell)
{
  ivec4 v = cell * 1664525 + 1013904223;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  v = v ^ (v >> 16);
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return vec4(v & 0x7fffffff) * HASH_INT_RANGE;
}
