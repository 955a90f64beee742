/* One virtual point light of this sample's pool, chosen in proportion to its strength: first the tile, then blocks of
 * PYRAMID_STEP^3, ^2 and ^1 texels (64, 16, 4) along a side, then the texel (hierarchical warping, Clarberg et al. 2005).
 * Entry k takes the k-th of equal parts of the whole strength, so that the pool is stratified over the lights and over
 * each light's map. */
#include "lib/sampling_lib.glsl"
#include "vpl/vpl_lib.glsl"
#include "vpl/vpl_strength_lib.glsl"

/* A seed for each pool: mixed, for there are more pools than seeds set apart for them. */
int pool_seed()
{
  return pc_seed ^ int(sampling_pcg3d(uvec3(uint(pc_number), 0u, 0u)).x >> 2u);
}

/* A number in [0, 1) that still has random bits after many choices: what is left of the last, stirred. */
float pool_stir(float rest, int entry, int level)
{
  return fract(rest + sampling_hash(ivec2(entry, level), pool_seed()).x);
}

/* Take one of the cells in [first, end) of one level in proportion to its strength. `u` in [0, 1) chooses; it is
 * rescaled to what is left of it. */
#define POOL_CHOOSE(STRENGTH)                                                                                          \
  {                                                                                                                    \
    float sum = 0.0;                                                                                                   \
    for (int y = first.y; y < end.y; y++) {                                                                            \
      for (int x = first.x; x < end.x; x++) {                                                                          \
        sum += STRENGTH(ivec2(x, y));                                                                                  \
      }                                                                                                                \
    }                                                                                                                  \
    float left = u * sum;                                                                                              \
    bool found = false;                                                                                                \
    for (int y = first.y; y < end.y; y++) {                                                                            \
      for (int x = first.x; x < end.x; x++) {                                                                          \
        float part = STRENGTH(ivec2(x, y));                                                                            \
        if (!found && part > 0.0) {                                                                                    \
          cell = ivec2(x, y);                                                                                          \
          u = clamp(left / part, 0.0, 0.99999994);                                                                     \
          found = left < part;                                                                                         \
        }                                                                                                              \
        left -= found ? 0.0 : part;                                                                                    \
      }                                                                                                                \
    }                                                                                                                  \
  }

/* Along a side of a cell of the middle level. */
const int POOL_MIDDLE_TEXELS = PYRAMID_STEP * PYRAMID_STEP;

#define POOL_COARSE(texel) texelFetch(coarse_tx, texel, 0).r
#define POOL_MIDDLE(texel) texelFetch(middle_tx, texel, 0).r
#define POOL_FINE(texel) texelFetch(fine_tx, texel, 0).r
#define POOL_TEXEL(texel) vpl_texel_strength(flux_tx, specular_tx, texel)

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int entry = pixel.x + VPL_POOL_ROW * pixel.y;
  out_position = vec4(0.0);
  out_normal = vec4(0.0);
  out_flux = vec4(0.0);
  out_specular = vec4(0.0);
  float total = texelFetch(sums_tx, ivec2(pc_tiles - 1, 0), 0).y;
  if (entry >= pc_count || total <= 0.0) {
    return;
  }
  float u = (float(entry) + sampling_hash(ivec2(entry, 0), pool_seed()).y) / float(pc_count);
  float wanted = min(u, 0.99999994) * total;
  int index = vpl_tile_above(sums_tx, pc_tiles, VPL_SUM_ALL, wanted);
  vec4 sums = texelFetch(sums_tx, ivec2(index, 0), 0);
  VplTile tile = vpl_tile_fetch(tile_tx, index);
  ivec2 origin = ivec2(tile.origin);
  float before = index > 0 ? texelFetch(sums_tx, ivec2(index - 1, 0), 0).y : 0.0;
  u = clamp((wanted - before) / max(sums.y - before, 1e-30), 0.0, 0.99999994);

  ivec2 cell = ivec2(0);
  ivec2 first = origin / pc_tile * pc_coarse;
  ivec2 end = first + pc_coarse;
  POOL_CHOOSE(POOL_COARSE)
  ivec2 corner = origin / POOL_MIDDLE_TEXELS;
  first = corner + (cell - first) * PYRAMID_STEP;
  end = min(first + PYRAMID_STEP, corner + pc_tile / POOL_MIDDLE_TEXELS);
  POOL_CHOOSE(POOL_MIDDLE)
  u = pool_stir(u, entry, 1);
  first = cell * PYRAMID_STEP;
  end = first + PYRAMID_STEP;
  POOL_CHOOSE(POOL_FINE)
  u = pool_stir(u, entry, 2);
  first = cell * PYRAMID_STEP;
  end = first + PYRAMID_STEP;
  POOL_CHOOSE(POOL_TEXEL)

  float probability = sums.x * POOL_TEXEL(cell) / total;
  if (probability <= 0.0) {
    return;
  }
  vec4 position_area = texelFetch(position_area_tx, cell, 0);
  vec4 normal_kind = texelFetch(normal_kind_tx, cell, 0);
  float lights = texelFetch(sums_tx, ivec2(max(pc_light_tiles - 1, 0), 0), 0).z;
  float share = normal_kind.w == float(SOURCE_BOUNCE) ? sums.w / lights : 1.0;
  out_position = position_area;
  out_normal = vec4(octahedron_encode(normal_kind.xyz), share, intBitsToFloat(vpl_id(cell, int(normal_kind.w))));
  out_flux = vec4(texelFetch(flux_tx, cell, 0).rgb, probability);
  out_specular = texelFetch(specular_tx, cell, 0);
}
