/* The first candidates for a receiver's light: some of the pool, chosen for their strength alone, and one that a ray
 * with the receiver's cosine found, chosen for its nearness alone. Each is weighted by the balance heuristic (Veach &
 * Guibas 1995) of both, so that neither touching surfaces nor small bright patches make noise, and no clamp is needed.
 *
 * Names of samplers and constants are those of `CANDIDATES` in vpl/shaders.py. */
#include "frame/light_map_lib.glsl"
#include "frame/voxel_lib.glsl"
#include "lib/sampling_lib.glsl"
#include "vpl/vpl_lib.glsl"

/* A texel answers for a ray's hit that lies no farther away than so many voxels and so many of its own widths. */
const float CANDIDATES_VOXELS = 2.0;
const float CANDIDATES_TEXELS = 1.5;

/* Two unit vectors that make a frame with n (Duff et al. 2017). */
void candidates_frame(vec3 n, out vec3 x, out vec3 y)
{
  float s = n.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (s + n.z);
  float b = n.x * n.y * a;
  x = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
  y = vec3(b, s + n.y * n.y * a, -n.y);
}

vec3 candidates_cosine_direction(vec3 n, vec2 noise)
{
  vec3 x;
  vec3 y;
  candidates_frame(n, x, y);
  float radius = sqrt(noise.x);
  float angle = 2.0 * MATH_PI * noise.y;
  return radius * (cos(angle) * x + sin(angle) * y) + sqrt(max(1.0 - noise.x, 0.0)) * n;
}

/* One of the lights, in proportion to what its tiles send: index of one of its tiles, or -1; `share` its part. */
int candidates_light(float u, out float share)
{
  share = 0.0;
  float lights = pc_light_tiles > 0 ? texelFetch(sums_tx, ivec2(pc_light_tiles - 1, 0), 0).z : 0.0;
  if (lights <= 0.0) {
    return -1;
  }
  int low = 0;
  int high = pc_light_tiles - 1;
  while (low < high) {
    int middle = (low + high) / 2;
    if (texelFetch(sums_tx, ivec2(middle, 0), 0).z > u * lights) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  share = texelFetch(sums_tx, ivec2(low, 0), 0).w / lights;
  return low;
}

/* The texel that shows what a ray along `direction` hit at `hit`, in the map of one light; id 0 where the light does not
 * reach it. */
Vpl candidates_seen(vec3 hit, vec3 direction, int tile_index)
{
  Vpl none = Vpl(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), 0);
  Light light = light_fetch(light_tx, int(vpl_tile_fetch(tile_tx, tile_index).light));
  MapFace face = map_face_fetch(face_tx, light_map_face(light, face_tx, hit));
  vec3 p = map_position(face, hit);
  if (!map_holds(face, p)) {
    return none;
  }
  ivec2 texel = ivec2(face.origin + floor(map_uv(face, p) * face.tile));
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec4 normal_kind = texelFetch(normal_kind_tx, texel, 0);
  vec3 apart = place.xyz - hit;
  float near = CANDIDATES_VOXELS * voxel_grid.edge + CANDIDATES_TEXELS * sqrt(place.w);
  if (normal_kind.w == 0.0 || dot(apart, apart) > near * near || dot(normal_kind.xyz, direction) >= 0.0) {
    return none;
  }
  return Vpl(place.xyz, place.w, normal_kind.xyz, texelFetch(flux_tx, texel, 0).rgb, vpl_id(texel, VPL_BOUNCE));
}

/* The patch of sky in this direction. */
Vpl candidates_sky(vec3 direction)
{
  vec4 place = pc_sky; /* origin, side of its tile */
  ivec2 texel = ivec2(place.xy + min(floor((0.5 + 0.5 * octahedron_encode(direction)) * place.z), place.z - 1.0));
  int id = vpl_id(texel, VPL_SKY);
  return vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, id);
}

/* Fill a reservoir for the surface at P. `visible`: the chosen one is known to be seen from it. */
Reservoir candidates_choose(vec3 P, vec3 N, vec3 geometric, ivec2 pixel, int count, out bool visible)
{
  Reservoir r = Reservoir(0, 0.0, 0.0, 0.0);
  visible = false;
  vec2 start = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed));
  float u = start.y;
  float stratum = float(pc_pool) / float(count);
  float candidates = float(count);
  for (int i = 0; i < count; i++) {
    int entry = min(int((float(i) + start.x) * stratum), pc_pool - 1);
    ivec2 at = ivec2(entry % VPL_POOL_ROW, entry / VPL_POOL_ROW);
    vec4 flux = texelFetch(pool_flux_tx, at, 0);
    vec4 place = texelFetch(pool_position_tx, at, 0);
    vec4 facing = texelFetch(pool_normal_tx, at, 0);
    float form = vpl_form(place.xyz, place.w, octahedron_decode(facing.xy), P, N);
    float target = vpl_strength(flux.rgb) * form;
    float by_ray = facing.z * place.w * form * (1.0 / MATH_PI);
    reservoir_offer(r, floatBitsToInt(facing.w), target / max(candidates * flux.w + by_ray, 1e-30), target, u);
  }
  vec2 noise = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 1));
  vec3 direction = candidates_cosine_direction(N, noise);
  if (dot(direction, geometric) > 0.0) {
    vec3 origin = voxel_start(P, geometric);
    float far = voxel_trace(origin, direction, 1e30);
    float share = 1.0;
    Vpl seen = Vpl(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), 0);
    if (far >= 0.0) {
      vec2 choice = sampling_r2(pc_sample, sampling_hash(pixel, pc_seed + 2));
      int tile = candidates_light(choice.x, share);
      if (tile >= 0) {
        seen = candidates_seen(origin + (far + 0.5 * voxel_grid.edge) * direction, direction, tile);
      }
    } else if (pc_sky.z > 0.0) {
      seen = candidates_sky(direction);
    }
    float form = vpl_form(seen.position, seen.area, seen.normal, P, N);
    float target = vpl_strength(seen.flux) * form;
    if (seen.id != 0 && target > 0.0) {
      float total = texelFetch(sums_tx, ivec2(pc_tiles - 1, 0), 0).y;
      float by_pool = candidates * vpl_strength(seen.flux) / total;
      float by_ray = share * seen.area * form * (1.0 / MATH_PI);
      int before = r.id;
      float sum = r.sum;
      reservoir_offer(r, seen.id, target / max(by_pool + by_ray, 1e-30), target, u);
      visible = r.id == seen.id && (before != seen.id || sum != r.sum);
    }
  }
  r.seen = 1.0;
  return r;
}
