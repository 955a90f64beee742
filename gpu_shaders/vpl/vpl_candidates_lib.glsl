/* The first candidates for a receiver's light: some of the pool, chosen for their strength alone, and one that a ray
 * with the receiver's cosine found, chosen for its nearness alone. Each is weighted by the balance heuristic (Veach &
 * Guibas 1995) of both, so that neither touching surfaces nor small bright patches make noise, and no clamp is needed.
 *
 * LAMPS_ONLY leaves out what looks for emitters and the sky: software OpenGL skips no branch. Names of samplers are those of
 * `_CANDIDATES` in vpl/shaders.py, the uniform block vpl_frame that of vpl/structs.py. */
#include "frame/light_map_lib.glsl"
#include "lib/sampling_lib.glsl"
#include "vpl/vpl_cover_lib.glsl"
#include "vpl/vpl_form_lib.glsl"
#include "vpl/vpl_reach_lib.glsl"

/* A texel answers for a ray's hit that lies no farther away than so many voxels and so many of its own widths. */
const float CANDIDATES_VOXELS = 2.0;
const float CANDIDATES_TEXELS = 1.5;
/* A point on an emitter answers for hits up to so many cells of the index away: a cell's diagonal. */
const float CANDIDATES_CELLS = 1.75;
/* and besides so many times the points' own spacing. */
const float CANDIDATES_SPACING = 1.75;
/* Cells of the cache that are asked for a hit. */
const int CANDIDATES_ATTEMPTS = 4;
/* Other rays that stand in for one whose hit no point of the cache answers for. */
const int CANDIDATES_AGAIN = 2;
const vec2 CANDIDATES_TURN = vec2(0.7548777, 0.5698403);
/* A point of the cache answers for hits that lie so many cells off its plane. */
const float CANDIDATES_OFF_PLANE = 0.5;

/* Probability with which one entry of the pool is a light of that strength of this tile. */
float candidates_probability(int tile, float strength)
{
  float total = texelFetch(sums_tx, ivec2(vpl_frame.tiles - 1, 0), 0).y;
  return texelFetch(sums_tx, ivec2(tile, 0), 0).x * strength / total;
}

vec3 candidates_cosine_direction(vec3 n, vec2 noise)
{
  float radius = sqrt(noise.x);
  float angle = 2.0 * MATH_PI * noise.y;
  return bxdf_frame(n) * vec3(radius * cos(angle), radius * sin(angle), sqrt(max(1.0 - noise.x, 0.0)));
}

/* One of the lights, in proportion to what its tiles send: index of one of its tiles, or -1; `share` its part. */
int candidates_lamp(float u, out float share)
{
  share = 0.0;
  float lights = vpl_frame.light_tiles > 0 ? texelFetch(sums_tx, ivec2(vpl_frame.light_tiles - 1, 0), 0).z : 0.0;
  if (lights <= 0.0) {
    return -1;
  }
  int tile = vpl_tile_above(sums_tx, vpl_frame.light_tiles, VPL_SUM_LIGHTS, u * lights);
  share = texelFetch(sums_tx, ivec2(tile, 0), 0).w / lights;
  return tile;
}

/* The texel that shows what a ray along `direction` hit at `hit`, in the map of one light; id 0 where the light does not
 * reach it. `seen_tile`: the map that was asked. */
Vpl candidates_seen(vec3 hit, vec3 direction, int tile_index, out int seen_tile)
{
  Light light = light_fetch(light_tx, int(vpl_tile_fetch(tile_tx, tile_index).light));
  MapFace face = light_map_face(light, face_tx, hit, seen_tile); /* tiles and faces have one order */
  vec3 p = map_position(face, hit);
  if (!map_holds(face, p)) {
    return VPL_NONE;
  }
  ivec2 texel = ivec2(face.origin + floor(map_uv(face, p) * face.tile));
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec4 normal_kind = texelFetch(normal_kind_tx, texel, 0);
  vec3 apart = place.xyz - hit;
  float near = CANDIDATES_VOXELS * voxel_edge_at(hit) + CANDIDATES_TEXELS * sqrt(place.w);
  if (normal_kind.w == 0.0 || dot(apart, apart) > near * near || dot(normal_kind.xyz, direction) >= 0.0) {
    return VPL_NONE;
  }
  return vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, vpl_id(texel, SOURCE_BOUNCE));
}

/* The patch of sky in this direction. */
Vpl candidates_sky(vec3 direction)
{
  vec4 place = vpl_frame.sky; /* origin, side of its tile */
  ivec2 texel = ivec2(place.xy + min(floor((0.5 + 0.5 * octahedron_encode(direction)) * place.z), place.z - 1.0));
  int id = vpl_id(texel, SOURCE_SKY);
  return vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, id);
}

vec4 candidates_cube_of(int level)
{
  return level == 0   ? vpl_frame.index_0
         : level == 1 ? vpl_frame.index_1
         : level == 2 ? vpl_frame.index_2
         : level == 3 ? vpl_frame.index_3
         : level == 4 ? vpl_frame.index_4
                      : vpl_frame.index_5;
}

/* The level of the indices that knows the surroundings of P best, and its cube. */
vec4 candidates_cube(vec3 P, out int level)
{
  for (level = 0; level < vpl_frame.index_levels - 1; level++) {
    vec3 place = index_place(candidates_cube_of(level), P);
    if (all(greaterThanEqual(place, vec3(0.0))) && all(lessThan(place, vec3(float(VPL_INDEX))))) {
      break;
    }
  }
  return candidates_cube_of(level);
}

/* Texel of the cache's point at `place`, out of one for each way that the surface may face, whose plane the hit of a ray
 * lies on best and no farther off than `nearest`; or -1. */
ivec2 candidates_cached(vec3 hit, vec3 direction, vec3 place, int level, float nearest)
{
  ivec2 best = ivec2(-1);
  for (int axis = 0; axis < 3; axis++) {
    int point = index_point(cache_index_tx, level, place, index_side(axis, -direction[axis]));
    ivec2 texel = index_atlas_texel(vpl_frame.cache, max(point, 0));
    vec3 n = texelFetch(normal_kind_tx, texel, 0).xyz;
    float off = abs(dot(texelFetch(position_area_tx, texel, 0).xyz - hit, n));
    if (point >= 0 && vpl_frame.cache.z > 0.0 && dot(n, direction) < 0.0 && off < nearest) {
      nearest = off;
      best = texel;
    }
  }
  return best;
}

/* Radiance that the cache holds for what a ray hit after `far`, and the part of it that came from the sky: that of the
 * point whose plane the hit lies on best, out of one for each way that the surface may face, if nothing is between it and
 * the hit. The cell is jittered, so that over many rays the cells' values blend; cells that know nothing of the hit are
 * passed over. Where all do, it is not `known`: what is hidden is never believed, or light would pass walls. */
vec3 candidates_carried(vec3 hit, vec3 direction, float far, vec3 noise, out bool known, out vec3 from_sky)
{
  float edge = voxel_edge_at(hit);
  int level;
  vec4 cube = candidates_cube(hit, level);
  vec3 before = hit - min(2.0 * edge, far + 0.45 * edge) * direction;
  int attempts = vpl_frame.cache.z > 0.0 ? CANDIDATES_ATTEMPTS + vpl_frame.index_levels - 1 : 0;
  int attempt = 0;
  ivec2 answer = ivec2(-1);
  do {
    ivec2 best;
    do {
      if (attempt >= CANDIDATES_ATTEMPTS && level < vpl_frame.index_levels - 1) {
        level++; /* points of a huge ground lie many of these cells apart */
        cube = candidates_cube_of(level);
      }
      vec3 aside = fract(noise + float(attempt) * vec3(0.8191725, 0.6710436, 0.5497005)) - 0.5;
      best = candidates_cached(hit, direction, index_place(cube, hit) + aside, level,
                               CANDIDATES_VOXELS * edge + CANDIDATES_OFF_PLANE / cube.w);
      attempt++;
    } while (best.x < 0 && attempt < attempts);
    if (best.x >= 0) {
      vec3 n = texelFetch(normal_kind_tx, best, 0).xyz;
      bool clear = voxel_clear(before, voxel_start(texelFetch(position_area_tx, best, 0).xyz, n));
      answer = clear ? best : answer;
    }
  } while (answer.x < 0 && attempt < attempts);
  known = answer.x >= 0;
  from_sky = vec3(0.0);
  if (!known) {
    return vec3(0.0);
  }
  vec4 sum = texelFetch(cache_sky_tx, answer - ivec2(vpl_frame.cache.xy), 0);
  from_sky = sum.rgb / max(sum.w, 1.0) * texelFetch(specular_tx, answer, 0).rgb; /* the cache's reflectance */
  return index_radiance(position_area_tx, flux_tx, answer);
}

/* Which part of what a ray along `direction` hit at `hit` an emitter covers whose points stand for `area` each: the area of
 * points in the cell and in the one behind it, as a surface may lie on the border of both, over the cell's. Small emitters
 * would else shine from all that lies near them. */
float candidates_cover(vec3 hit, vec3 direction, float area)
{
  int level;
  candidates_cube(hit, level);
  int scale = cover_scale(area, voxel_edge_at(hit));
  ivec2 base = ivec2(0, vpl_frame.index_levels * INDEX_SIZE.y);
  ivec3 at = cover_cell(hit, scale);
  vec3 covered = vec3(0.0);
  for (int i = 0; i < 6; i++) {
    int axis = i >> 1;
    ivec3 other = at;
    other[axis] += (i & 1) * (direction[axis] < 0.0 ? -1 : 1);
    ivec3 place = cover_place(other, scale, level, index_side(axis, -direction[axis]));
    covered[axis] += texelFetch(emitter_index_tx, base + place.xy, 0)[place.z];
  }
  /* Of the sides by which it is seen, the more it covers of one the more that counts: a flat emitter has one. */
  vec3 seen = abs(direction) * covered;
  float cell = exp2(2.0 * float(scale));
  float part = dot(seen, covered) / max(seen.x + seen.y + seen.z, 1e-30) / cell;
  return min(1.0, part * (1.0 + 0.5 * sqrt(area / cell))); /* some cells have fewer points than others */
}

/* Texel of the emitter's point that answers for what a ray along `direction` hit at `hit`, or -1: the hit must lie on its
 * plane, and no farther from it than the cells around it reach. */
ivec2 candidates_emitter(vec3 hit, vec3 direction)
{
  int level;
  vec4 cube = candidates_cube(hit, level);
  vec3 place = index_place(cube, hit);
  float edge = voxel_edge_at(hit);
  ivec2 answer = ivec2(-1);
  for (int axis = 0; axis < 3; axis++) {
    int point = index_point(emitter_index_tx, level, place, index_side(axis, -direction[axis]));
    ivec2 texel = index_atlas_texel(vpl_frame.emitters, max(point, 0));
    vec3 n = texelFetch(normal_kind_tx, texel, 0).xyz;
    vec4 at = texelFetch(position_area_tx, texel, 0);
    vec3 apart = hit - at.xyz;
    bool near = abs(dot(apart, n)) < CANDIDATES_VOXELS * edge &&
                length(apart) < CANDIDATES_CELLS / cube.w + CANDIDATES_SPACING * sqrt(at.w);
    bool answers = point >= 0 && vpl_frame.emitters.z > 0.0 && dot(n, direction) < 0.0 && near;
    answer = answers && answer.x < 0 ? texel : answer;
  }
  return answer;
}

/* Irradiance / pi from the emitter that a ray from P along `direction` hit at `hit`, weighted against what the pool finds
 * of it by the balance heuristic. */
vec3 candidates_emitted(vec3 P, vec3 N, vec3 hit, vec3 direction)
{
  ivec2 texel = candidates_emitter(hit, direction);
  if (texel.x < 0) {
    return vec3(0.0);
  }
  float area = texelFetch(position_area_tx, texel, 0).w;
  float cosine = -dot(texelFetch(normal_kind_tx, texel, 0).xyz, direction);
  vec3 flux = texelFetch(flux_tx, texel, 0).rgb;
  vec3 to_hit = hit - P;
  float by_ray = dot(N, direction) * cosine / (MATH_PI * max(dot(to_hit, to_hit), 1e-20));
  float by_pool =
      float(vpl_frame.candidates) * candidates_probability(vpl_frame.emitter_tile, vpl_strength(flux)) / area;
  return flux / (MATH_PI * area) * (by_ray / (by_ray + by_pool));
}

/* Radiance that the cache holds for what a receiver's ray hits, and how far that is, negative if it hits nothing. Where no
 * point answers for the hit, another ray's stands in: what is not known is taken for the mean of what the receiver sees,
 * not for black, and still nothing passes a wall. */
vec3 candidates_bounced(vec3 origin, vec3 N, vec3 geometric, vec2 noise, vec3 cell_noise, out float far,
                        out vec3 from_sky)
{
  vec3 carried = vec3(0.0);
  from_sky = vec3(0.0);
  bool known = false;
  int again = 0;
  do {
    vec3 direction = candidates_cosine_direction(N, fract(noise + float(again) * CANDIDATES_TURN));
    float reach = dot(direction, geometric) > 0.0 ? voxel_trace(origin, direction, 1e30) : -1.0;
    if (reach >= 0.0) {
      vec3 hit = origin + (reach + 0.5 * voxel_grid.edge) * direction;
      carried = candidates_carried(hit, direction, reach, cell_noise, known, from_sky);
    }
    far = again == 0 ? reach : far;
    again++;
  } while (far >= 0.0 && !known && again <= CANDIDATES_AGAIN && vpl_frame.cache.z > 0.0);
  return carried;
}

/* Fill a reservoir for the surface at P, whose rays begin at `origin` (voxel_start_seen), from lights of `kinds`, bits of
 * SourceKind. `visible`: the chosen one is known to be seen from it. `carried` and `emitted` are one ray's estimates of the
 * irradiance / pi from the cache, and from emitters; `from_sky` the part of `carried` that came from the sky. Receivers and
 * their rounds, of the same sample, differ in `pixel` or in `round`. */
Reservoir candidates_choose(vec3 P, vec3 N, vec3 geometric, vec3 origin, ivec2 pixel, int round, int kinds,
                            out bool visible, out vec3 carried, out vec3 from_sky, out vec3 emitted)
{
  Reservoir r = Reservoir(0, 0.0, 0.0, 0.0);
  visible = false;
  emitted = vec3(0.0);
  int count = vpl_frame.candidates;
  int seed = vpl_frame.seed + 4 * round;
  vec2 start = sampling_r2(vpl_frame.number, sampling_hash(pixel, seed));
  float u = start.y;
  float stratum = float(vpl_frame.pool) / float(count);
  float candidates = float(count);
  int i = 0;
  do {
    int entry = min(int((float(i) + start.x) * stratum), vpl_frame.pool - 1);
    ivec2 at = ivec2(entry % VPL_POOL_ROW, entry / VPL_POOL_ROW);
    vec4 facing = texelFetch(pool_normal_tx, at, 0);
    int id = floatBitsToInt(facing.w);
    bool wanted = (kinds >> vpl_id_kind(id) & 1) != 0;
    vec4 flux = texelFetch(pool_flux_tx, at, 0);
    vec4 place = texelFetch(pool_position_tx, at, 0);
    float form = wanted ? vpl_form(place.xyz, place.w, octahedron_decode(facing.xy), P, N) : 0.0;
    vec3 toward = flux.rgb;
#ifdef GLOSSY
    vec4 specular = texelFetch(pool_specular_tx, at, 0);
    if (vpl_id_kind(id) == SOURCE_BOUNCE) {
      toward = vpl_flux_toward(toward, specular, octahedron_decode(facing.xy), normalize(P - place.xyz));
    }
#endif
    float target = vpl_strength(toward) * form;
    float by_ray = facing.z * place.w * form * (1.0 / MATH_PI);
    reservoir_offer(r, id, target / max(candidates * flux.w + by_ray, 1e-30), target, u);
    i++;
  } while (i < count);
  vec2 noise = sampling_r2(vpl_frame.number, sampling_hash(pixel, seed + 1));
  vec2 choice = sampling_r2(vpl_frame.number, sampling_hash(pixel, seed + 2));
  vec3 cell_noise = vec3(sampling_hash(pixel, seed + 3), choice.y);
  vec3 direction = candidates_cosine_direction(N, noise);
  float far;
  carried = candidates_bounced(origin, N, geometric, noise, cell_noise, far, from_sky);
  float share = 1.0;
  int seen_tile = 0;
  Vpl seen = VPL_NONE;
  if (far >= 0.0) {
    vec3 hit = origin + (far + 0.5 * voxel_grid.edge) * direction;
#ifndef LAMPS_ONLY
    emitted = candidates_emitted(P, N, hit, direction);
#endif
    int tile = (kinds >> SOURCE_BOUNCE & 1) != 0 ? candidates_lamp(choice.x, share) : -1;
    if (tile >= 0) {
      seen = candidates_seen(hit, direction, tile, seen_tile);
    }
  }
#ifndef LAMPS_ONLY
  else if (dot(direction, geometric) > 0.0 && vpl_frame.sky.z > 0.0 && (kinds >> SOURCE_SKY & 1) != 0) {
    seen = candidates_sky(direction);
    seen_tile = vpl_frame.sky_tile;
  }
#endif
  float form = vpl_form(seen.position, seen.area, seen.normal, P, N);
  vec3 toward = vpl_flux_toward(seen.flux, seen.specular, seen.normal, -direction);
  float target = vpl_strength(toward) * form;
  if (seen.id != 0 && target > 0.0) {
    float strength = seen.counts * (vpl_strength(seen.flux) + vpl_strength(seen.specular.rgb));
    float by_pool = candidates * candidates_probability(seen_tile, strength);
    float by_ray = share * seen.area * form * (1.0 / MATH_PI);
    int before = r.id;
    float sum = r.sum;
    reservoir_offer(r, seen.id, target / max(by_pool + by_ray, 1e-30), target, u);
    visible = r.id == seen.id && (before != seen.id || sum != r.sum);
  }
  r.seen = 1.0;
  return r;
}

/* The chosen light's irradiance / pi, if it is seen. */
vec3 candidates_light(Reservoir r, bool visible, vec3 P, vec3 N, vec3 origin)
{
  if (r.id == 0) {
    return vec3(0.0);
  }
  Vpl vpl = vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, r.id);
  if (!visible && !reach_sees(P, origin, vpl)) {
    return vec3(0.0);
  }
  return vpl_light(vpl, P, N) * (r.sum / r.target);
}
