/* The disc of Dachsbacher & Stamminger 2005, section 4 and figure 4: texels around the receiver's own place in the map,
 * (s + r_max xi1 sin 2 pi xi2, t + r_max xi1 cos 2 pi xi2), so their density falls as 1 / r from the centre.
 *
 * PUBLISHED  weight xi1^2, scaled by the texels in the disc over the sum of weights, so that map size and sample count
 *            do not change the level. Light from beyond the disc is lost and near light is underweighted, as published.
 * otherwise  the exact weight of that density, 2 pi r_max^2 xi1, with half of the samples spread over the
 *            whole map and both halves weighted by the balance heuristic (Veach & Guibas 1995), so that the radius
 *            changes the noise and not the level. */
#include "frame/light_map_lib.glsl"
#include "lib/sampling_lib.glsl"
#include "rsm/rsm_lib.glsl"

/* Share of the samples that the disc gets. */
const float GATHER_DISC_SHARE = 0.5;
/* The mean of xi1^2. */
const float GATHER_PUBLISHED_MEAN = 1.0 / 3.0;

struct Gather {
  vec3 P;
  vec3 N;
  int face;   /* the face that looks the receiver's way */
  float tile; /* texels along a side of it, as of all faces of its light */
  /* The receiver's place in it, tile coordinates; the nearest one for a receiver that the map does not hold. */
  vec2 place;
};

vec3 gather_fetch(Gather g, int face_index, vec2 uv)
{
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThanEqual(uv, vec2(1.0)))) {
    return vec3(0.0);
  }
  MapFace face = map_face_fetch(rsm_face_tx, face_index);
  ivec2 texel = ivec2(face.origin + floor(uv * face.tile));
  return rsm_texel_light(texel, rsm_position_tx, rsm_normal_tx, rsm_flux_tx, g.P, g.N);
}

/* Tile coordinates of disc sample xi around the receiver's place. */
vec2 gather_disc_uv(Gather g, vec2 xi)
{
  float angle = 2.0 * MATH_PI * xi.y;
  return g.place + pc_radius * xi.x * vec2(sin(angle), cos(angle));
}

#ifdef PUBLISHED
vec3 gather_light(Gather g, int first_face, int face_count, vec2 shift)
{
  vec3 sum = vec3(0.0);
  for (int i = pc_first_gather; i < pc_last_gather; i++) {
    vec2 xi = sampling_r2(pc_sample * pc_gathers + i, shift);
    sum += xi.x * xi.x * gather_fetch(g, g.face, gather_disc_uv(g, xi));
  }
  float texels = MATH_PI * pc_radius * pc_radius * g.tile * g.tile;
  return sum * texels / (GATHER_PUBLISHED_MEAN * float(pc_gathers));
}
#else
vec3 gather_light(Gather g, int first_face, int face_count, vec2 shift)
{
  vec3 sum = vec3(0.0);
  int in_disc = int(GATHER_DISC_SHARE * float(pc_gathers));
  float share = float(in_disc) / float(pc_gathers);
  for (int i = pc_first_gather; i < pc_last_gather; i++) {
    bool disc = i < in_disc;
    int index = disc ? pc_sample * in_disc + i : pc_sample * (pc_gathers - in_disc) + i - in_disc;
    vec2 xi = sampling_r2(index, disc ? shift : fract(shift.yx + 0.5));
    int face = g.face;
    vec2 uv;
    if (disc) {
      uv = gather_disc_uv(g, xi);
    } else {
      float pick = xi.x * float(face_count);
      face = first_face + min(int(pick), face_count - 1);
      uv = vec2(fract(pick), xi.y);
    }
    float r = distance(uv, g.place);
    float in_disc_density = face == g.face && r < pc_radius ? 1.0 / (2.0 * MATH_PI * max(r, 1e-6) * pc_radius) : 0.0;
    float density = share * in_disc_density + (1.0 - share) / float(face_count);
    sum += gather_fetch(g, face, uv) / density;
  }
  return sum * g.tile * g.tile / float(pc_gathers);
}
#endif

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy) * pc_stride + pc_offset;
  out_indirect = vec4(0.0);
  RsmReceiver receiver = rsm_receiver(pixel, ivec2(gl_FragCoord.xy), position_tx, normal_tx, reused_tx);
  if (!receiver.gathers) {
    return;
  }
  Gather g;
  g.P = receiver.P;
  g.N = receiver.N;
  vec3 sum = vec3(0.0);
  for (int i = pc_first_light; i < pc_last_light; i++) {
    Light light = light_fetch(light_tx, i);
    MapFace face = light_map_face(light, rsm_face_tx, g.P, g.face);
    g.tile = face.tile;
    vec3 p = map_position(face, g.P);
    p.z = max(p.z, face.near);
    g.place = clamp(map_uv(face, p), vec2(0.0), vec2(1.0));
    sum += gather_light(g, light.first_face, light.face_count, sampling_hash(pixel, pc_seed + i));
  }
  out_indirect = vec4(sum, 1.0);
}
