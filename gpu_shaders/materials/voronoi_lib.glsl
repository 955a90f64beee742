/* Cells around random points, one in each cell of a grid (Worley 1996); distances to edges after Quilez. Unused
 * coordinates are 0. `metric` is euclidean (0), manhattan (1), chebychev (2) or minkowski (3). */
#include "materials/hash_lib.glsl"

const float VORONOI_FAR = 3e38;

struct Voronoi {
  int dimensions;
  int metric;
  float detail;
  float roughness;
  float lacunarity;
  float smoothness;
  float exponent;
  float randomness;
};

struct VoronoiCell {
  float distance;
  vec3 color;
  vec4 position;
};

Voronoi voronoi_settings(int dimensions, int metric, float detail, float roughness, float lacunarity, float smoothness,
                         float exponent, float randomness)
{
  return Voronoi(dimensions, metric, clamp(detail, 0.0, 15.0), clamp(roughness, 0.0, 1.0), lacunarity,
                 clamp(smoothness / 2.0, 0.0, 0.5), exponent, clamp(randomness, 0.0, 1.0));
}

/* Where its point lies in a cell, 0..1. Blender 5.0 drew it by another hash. */
vec4 voronoi_point(vec4 cell, int dimensions)
{
  if (dimensions == 1) {
    return vec4(hash_float(cell, 1), 0.0, 0.0, 0.0);
  }
#if VORONOI_FLOAT_HASH
  if (dimensions == 2) {
    return vec4(hash_float(cell, 2), hash_float(vec4(cell.xy, 1.0, 0.0), 3), 0.0, 0.0);
  }
  if (dimensions == 3) {
    return vec4(hash_color(cell, 3), 0.0);
  }
  return vec4(hash_float(cell, 4), hash_float(cell.wxyz, 4), hash_float(cell.zwxy, 4), hash_float(cell.yzwx, 4));
#else
  ivec4 k = ivec4(cell);
  return dimensions == 2   ? vec4(hash_cell_2(k.xy), 0.0, 0.0)
         : dimensions == 3 ? vec4(hash_cell_3(k.xyz), 0.0)
                           : hash_cell_4(k);
#endif
}

vec3 voronoi_color(vec4 cell, int dimensions)
{
#if VORONOI_FLOAT_HASH
  return hash_color(cell, dimensions);
#else
  ivec4 k = ivec4(cell);
  return dimensions == 1   ? hash_color(cell, 1)
         : dimensions == 2 ? hash_cell_3(ivec3(k.xy, 0))
         : dimensions == 3 ? hash_cell_3(k.xyz)
                           : hash_cell_4(k).xyz;
#endif
}

float voronoi_distance(vec4 d, Voronoi v)
{
  d = abs(d);
  if (v.metric == 0 || v.dimensions == 1) {
    return length(d);
  }
  if (v.metric == 1) {
    return d.x + d.y + d.z + d.w;
  }
  if (v.metric == 2) {
    return max(max(d.x, d.y), max(d.z, d.w));
  }
  vec4 power = pow(d, vec4(v.exponent));
  return pow(power.x + power.y + power.z + power.w, 1.0 / v.exponent);
}

/* The k-th of the cells within `reach` of one, the first coordinate fastest. */
int voronoi_count(int reach, int dimensions)
{
  int side = 2 * reach + 1;
  return dimensions == 1   ? side
         : dimensions == 2 ? side * side
         : dimensions == 3 ? side * side * side
                           : side * side * side * side;
}

vec4 voronoi_offset(int k, int reach, int dimensions)
{
  int side = 2 * reach + 1;
  ivec4 at = ivec4(k % side, k / side % side, k / (side * side) % side, k / (side * side * side)) - reach;
  return vec4(at.x, dimensions > 1 ? at.y : 0, dimensions > 2 ? at.z : 0, dimensions > 3 ? at.w : 0);
}

/* The nearest point, or with `second` the one after it. */
VoronoiCell voronoi_nearest(vec4 p, Voronoi v, bool second)
{
  vec4 cell = floor(p), place = p - cell;
  VoronoiCell first = VoronoiCell(VORONOI_FAR, vec3(0.0), vec4(0.0)), next = first;
  vec4 first_cell = vec4(0.0), next_cell = vec4(0.0);
  for (int k = 0; k < voronoi_count(1, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 1, v.dimensions);
    vec4 point = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness;
    float away = voronoi_distance(point - place, v);
    if (away < first.distance) {
      next = first;
      next_cell = first_cell;
      first.distance = away;
      first.position = point;
      first_cell = offset;
    } else if (away < next.distance) {
      next.distance = away;
      next.position = point;
      next_cell = offset;
    }
  }
  VoronoiCell found = first;
  if (second) {
    found = next;
    first_cell = next_cell;
  }
  found.color = voronoi_color(cell + first_cell, v.dimensions);
  found.position += cell;
  return found;
}

VoronoiCell voronoi_octave_f1(vec4 p, Voronoi v)
{
  return voronoi_nearest(p, v, false);
}

VoronoiCell voronoi_octave_f2(vec4 p, Voronoi v)
{
  return voronoi_nearest(p, v, true);
}

/* The nearest by a smooth minimum, over cells of twice the reach. */
VoronoiCell voronoi_octave_smooth_f1(vec4 p, Voronoi v)
{
  if (v.smoothness == 0.0) {
    return voronoi_octave_f1(p, v);
  }
  vec4 cell = floor(p), place = p - cell;
  VoronoiCell mixed = VoronoiCell(0.0, vec3(0.0), vec4(0.0));
  for (int k = 0; k < voronoi_count(2, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 2, v.dimensions);
    vec4 point = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness;
    float away = voronoi_distance(point - place, v);
    float h = k == 0 ? 1.0 : smoothstep(0.0, 1.0, 0.5 + 0.5 * (mixed.distance - away) / v.smoothness);
    float less = v.smoothness * h * (1.0 - h);
    mixed.distance = mix(mixed.distance, away, h) - less;
    less /= 1.0 + 3.0 * v.smoothness;
    mixed.color = mix(mixed.color, voronoi_color(cell + offset, v.dimensions), h) - less;
    mixed.position = mix(mixed.position, point, h) - less;
  }
  mixed.position *= vec4(1.0, v.dimensions > 1, v.dimensions > 2, v.dimensions > 3);
  mixed.position += cell;
  return mixed;
}

/* How far the edge to the nearest neighbouring cell is: half-way between two points. */
float voronoi_octave_edge(vec4 p, Voronoi v)
{
  vec4 cell = floor(p), place = p - cell, closest = vec4(0.0);
  if (v.dimensions == 1) {
    float middle = voronoi_point(cell, 1).x * v.randomness;
    float left = voronoi_point(cell - vec4(1.0, 0.0, 0.0, 0.0), 1).x * v.randomness - 1.0;
    float right = voronoi_point(cell + vec4(1.0, 0.0, 0.0, 0.0), 1).x * v.randomness + 1.0;
    return min(abs((middle + left) / 2.0 - place.x), abs((middle + right) / 2.0 - place.x));
  }
  float least = VORONOI_FAR;
  for (int k = 0; k < voronoi_count(1, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 1, v.dimensions);
    vec4 way = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness - place;
    if (dot(way, way) < least) {
      least = dot(way, way);
      closest = way;
    }
  }
  least = VORONOI_FAR;
  for (int k = 0; k < voronoi_count(1, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 1, v.dimensions);
    vec4 way = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness - place;
    vec4 across = way - closest;
    if (dot(across, across) > 0.0001) {
      least = min(least, dot((closest + way) / 2.0, normalize(across)));
    }
  }
  return least;
}

/* Half the way from the nearest point to the point nearest to it. */
float voronoi_radius(vec4 p, Voronoi v)
{
  vec4 cell = floor(p), place = p - cell, closest = vec4(0.0), closest_offset = vec4(0.0);
  float least = VORONOI_FAR;
  for (int k = 0; k < voronoi_count(1, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 1, v.dimensions);
    vec4 point = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness;
    if (distance(point, place) < least) {
      least = distance(point, place);
      closest = point;
      closest_offset = offset;
    }
  }
  least = VORONOI_FAR;
  for (int k = 0; k < voronoi_count(1, v.dimensions); k++) {
    vec4 offset = voronoi_offset(k, 1, v.dimensions);
    if (offset != vec4(0.0)) {
      offset += closest_offset;
      vec4 point = offset + voronoi_point(cell + offset, v.dimensions) * v.randomness;
      least = min(least, distance(point, closest));
    }
  }
  return least / 2.0;
}

/* The greatest distance that one octave can give. */
float voronoi_largest(Voronoi v)
{
  vec4 corner = vec4(0.5 + 0.5 * v.randomness);
  return voronoi_distance(corner * vec4(1.0, v.dimensions > 1, v.dimensions > 2, v.dimensions > 3), v);
}

/* One more octave added to a sum, by its amplitude. */
VoronoiCell voronoi_add(VoronoiCell sum, VoronoiCell octave, float amplitude, float scale)
{
  return VoronoiCell(sum.distance + octave.distance * amplitude, sum.color + octave.color * amplitude,
                     mix(sum.position, octave.position / scale, amplitude));
}

VoronoiCell voronoi_mix(VoronoiCell a, VoronoiCell b, float t)
{
  return VoronoiCell(mix(a.distance, b.distance, t), mix(a.color, b.color, t), mix(a.position, b.position, t));
}

/* Brings a sum of octaves to 0..1 if asked, and its place back to the texture's space. */
VoronoiCell voronoi_finish(VoronoiCell sum, float amplitudes, float largest, bool normalized, float scale)
{
  if (normalized) {
    sum.distance /= amplitudes * largest;
    sum.color /= amplitudes;
  }
  sum.position = scale != 0.0 ? sum.position / scale : vec4(0.0);
  return sum;
}

/* feature: F1 (0), F2 (1), smooth F1 (2). */
VoronoiCell voronoi_octave(vec4 p, Voronoi v, int feature)
{
  if (feature == 0) {
    return voronoi_octave_f1(p, v);
  }
  if (feature == 1) {
    return voronoi_octave_f2(p, v);
  }
  return voronoi_octave_smooth_f1(p, v);
}

/* Octaves as of fBM; positions are mixed instead of added. */
VoronoiCell voronoi_texture(vec4 p, float scale, Voronoi v, int feature, bool normalized)
{
  float largest = voronoi_largest(v) * (feature == 1 ? 2.0 : 1.0);
  p *= scale;
  if (v.detail == 0.0 || v.roughness == 0.0) {
    return voronoi_finish(voronoi_octave(p, v, feature), 1.0, largest, normalized, scale);
  }
  VoronoiCell sum = VoronoiCell(0.0, vec3(0.0), vec4(0.0));
  float amplitude = 1.0, amplitudes = 0.0, zoom = 1.0;
  for (int i = 0; i <= int(ceil(v.detail)); i++) {
    float share = min(v.detail - float(i) + 1.0, 1.0);
    VoronoiCell octave = voronoi_octave(p * zoom, v, feature);
    sum = voronoi_mix(sum, voronoi_add(sum, octave, amplitude, zoom), share);
    amplitudes += share * amplitude;
    zoom *= v.lacunarity;
    amplitude *= v.roughness;
  }
  return voronoi_finish(sum, amplitudes, largest, normalized, scale);
}

/* The least distance to an edge of any octave, those of finer ones by their amplitude. */
float voronoi_edge(vec4 p, float scale, Voronoi v, bool normalized)
{
  float largest = 0.5 + 0.5 * v.randomness, range = largest;
  float least = 8.0, amplitude = 1.0, zoom = 1.0;
  p *= scale;
  if (v.detail == 0.0 || v.roughness == 0.0) {
    least = voronoi_octave_edge(p, v);
    return normalized ? least / range : least;
  }
  for (int i = 0; i <= int(ceil(v.detail)); i++) {
    float share = min(v.detail - float(i) + 1.0, 1.0);
    float found = mix(least, min(least, voronoi_octave_edge(p * zoom, v) / zoom), amplitude);
    least = mix(least, share < 1.0 ? min(least, found) : found, share);
    range = mix(range, mix(range, largest / zoom, amplitude), share);
    zoom *= v.lacunarity;
    amplitude *= v.roughness;
  }
  return normalized ? least / range : least;
}

vec4 voronoi_place(vec3 vector, float w, int dimensions)
{
  return dimensions == 1   ? vec4(w, 0.0, 0.0, 0.0)
         : dimensions == 2 ? vec4(vector.xy, 0.0, 0.0)
         : dimensions == 3 ? vec4(vector, 0.0)
                           : vec4(vector, w);
}
