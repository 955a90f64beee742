/* Strength of every tile, one texel a tile. */

void main()
{
  VplTile tile = vpl_tile_fetch(tile_tx, int(gl_FragCoord.x));
  ivec2 first = ivec2(tile.origin) / pc_tile * pc_blocks;
  float sum = 0.0;
  for (int i = 0; i < pc_blocks * pc_blocks; i++) {
    sum += texelFetch(level_tx, first + ivec2(i % pc_blocks, i / pc_blocks), 0).r;
  }
  out_sum = vec4(sum);
}
