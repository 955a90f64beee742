/* What a glossy surface reflects to the eye, over its lobe's albedo: one ray along a normal that the eye sees
 * (bxdf_sample_ggx), and what it finds there: the light that lamps' maps hold for the place, that of the cache, emitters,
 * or the world. */
#include "lib/environment_lib.glsl"
#include "vpl/vpl_candidates_lib.glsl"
#include "vpl/vpl_surface_lib.glsl"

/* Apart from the seeds of the candidates. */
const int REFLECT_SEED = 2048;
/* Lamps that are asked for the light of a hit; where there are more, each as often as its part of all light. */
const int REFLECT_LAMPS = 4;

/* What the lamps' maps show of a hit: each of a few tiles, chosen by strength and spread evenly. */
vec3 reflect_lamps(vec3 hit, vec3 direction, float u)
{
  vec3 light = vec3(0.0);
  for (int i = 0; i < REFLECT_LAMPS; i++) {
    float share;
    int tile = candidates_lamp((float(i) + u) / float(REFLECT_LAMPS), share);
    if (tile < 0) {
      break;
    }
    int seen_tile;
    Vpl seen = candidates_seen(hit, direction, tile, seen_tile);
    light += seen.id != 0 ? vpl_radiance(seen, -direction) / (share * float(REFLECT_LAMPS)) : vec3(0.0);
  }
  return light;
}

void main()
{
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * pc_stride + pc_offset, textureSize(position_tx, 0) - 1);
  out_surface = vec4(0.0);
  out_indirect = vec4(0.0);
  out_direct = vec4(0.0);
  vec4 position = texelFetch(position_tx, pixel, 0);
  vec3 P = position.xyz;
  int has = int(position.w);
  vec4 specular = texelFetch(specular_color_tx, pixel, 0);
  if (position.w <= 0.0 || specular.rgb == vec3(0.0)) {
    return;
  }
  vec4 packed_normals = texelFetch(normal_tx, pixel, 0);
  vec3 N = octahedron_decode(packed_normals.xy);
  vec3 geometric = octahedron_decode(packed_normals.zw);
  vec3 V = math_toward(P, vpl_frame.eye);
  out_surface = surface_pack(P, N);
  out_indirect.w = specular.a;
  int seed = vpl_frame.seed + REFLECT_SEED;
  vec2 noise = sampling_r2(vpl_frame.number, sampling_hash(pixel, seed));
  vec3 direction = bxdf_sample_ggx(N, V, specular.a, noise);
  vec3 weight = bxdf_specular_weight(N, V, direction, specular.rgb, specular.a) /
                max(bxdf_albedo(specular.rgb, specular.a, dot(N, V)), vec3(1e-4));
  if (dot(direction, geometric) <= 0.0 || weight == vec3(0.0)) {
    return;
  }
  vec3 origin = voxel_start_seen(P, geometric, V);
  float far = voxel_trace(origin, direction, 1e30);
  if (far < 0.0) {
    if (vpl_frame.mirrored != 0 && (has & HAS_SKY_MIRRORED) == 0) {
      float density = bxdf_sample_density(N, V, direction, specular.a);
      float level = environment_level_of_ray(environment_tx, density, vpl_frame.number);
      out_direct = vec4(weight * environment_radiance(environment_tx, direction, level), 1.0);
    }
    return;
  }
  vec3 hit = origin + (far + 0.5 * voxel_grid.edge) * direction;
  ivec2 emitter = candidates_emitter(hit, direction);
  if (emitter.x >= 0) {
    float part = candidates_cover(hit, direction, texelFetch(position_area_tx, emitter, 0).w);
    out_direct = vec4(part * weight * index_radiance(position_area_tx, flux_tx, emitter), 1.0);
  }
  vec2 choice = sampling_r2(vpl_frame.number, sampling_hash(pixel, seed + 1));
  bool known;
  vec3 from_sky;
  vec3 cell_noise = vec3(sampling_hash(pixel, seed + 2), choice.y);
  vec3 light = candidates_carried(hit, direction, far, cell_noise, known, from_sky);
  light -= (has & HAS_SKY_MIRRORED) != 0 && (has & HAS_SKY_BOUNCES) != 0 ? from_sky : vec3(0.0);
  light += reflect_lamps(hit, direction, choice.x);
  out_indirect.rgb = weight * light;
}
