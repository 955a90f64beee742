/* UDIM tiles of an image, that lie in one texture: their places are texels of the materials' values, four numbers each,
 * tile 1001 first. `value_fetch` is the generated shader's. */

#include "materials/texture_lib.glsl"

/* The tile under `uv`; magenta where there is none. `table`: texel of the first place, of `tiles`. */
vec4 tile_sample(sampler2D image_tx, vec2 uv, int table, int tiles, int filtering, int extension, int alpha,
                 bool is_srgb)
{
  ivec2 tile = ivec2(clamp(uv, vec2(-1.0), vec2(1e4))); // as in Cycles, just below 0 is tile 0's
  int number = tile.x + 10 * tile.y;
  ivec4 place = ivec4(0);
  if (all(greaterThanEqual(tile, ivec2(0))) && tile.x < 10 && number < tiles) {
    place = ivec4(value_fetch(table + number));
  }
  if (place.z == 0) {
    return vec4(1.0, 0.0, 1.0, 1.0);
  }
  return texture_in(image_tx, place, uv - vec2(tile), filtering, extension, alpha, is_srgb);
}

/* The first tile, for projections that know one only. */
ivec4 tile_first(sampler2D image_tx, int table)
{
  ivec4 place = ivec4(value_fetch(table));
  return place.z > 0 ? place : texture_whole(image_tx);
}
