/* Strength of every tile, and of all tiles up to and with it: what a tile is chosen by. One texel a tile; (tile, sum so
 * far, of lights only so far, of all tiles of its owner). */

float tiles_sum(int index)
{
  VplTile tile = vpl_tile_fetch(tile_tx, index);
  ivec2 first = ivec2(tile.origin) / pc_tile * pc_blocks;
  float sum = 0.0;
  for (int i = 0; i < pc_blocks * pc_blocks; i++) {
    sum += texelFetch(level_tx, first + ivec2(i % pc_blocks, i / pc_blocks), 0).r;
  }
  return sum;
}

void main()
{
  int index = int(gl_FragCoord.x);
  VplTile own = vpl_tile_fetch(tile_tx, index);
  float all = 0.0;
  float lights = 0.0;
  float owner = 0.0;
  float sum = 0.0;
  for (int i = 0; i < max(index + 1, own.first + own.owned); i++) {
    sum = tiles_sum(i);
    all += i <= index ? sum : 0.0;
    lights += i <= index && i < pc_light_tiles ? sum : 0.0;
    owner += i >= own.first && i < own.first + own.owned ? sum : 0.0;
  }
  out_tile = vec4(tiles_sum(index), all, lights, owner);
}
