/* What tiles are chosen by: their strength and, so that a strong lamp outside does not take all from a weak one inside, as
 * much again shared evenly among those that send anything. One texel a tile: (this weight over the strength; the sum of
 * weights so far; the same of lights only; that of all tiles of its owner). */

void main()
{
  int index = int(gl_FragCoord.x);
  VplTile own = vpl_tile_fetch(tile_tx, index);
  float strengths = 0.0;
  float sending = 0.0;
  for (int i = 0; i < pc_tiles; i++) {
    float strength = texelFetch(strength_tx, ivec2(i, 0), 0).r;
    strengths += strength;
    sending += strength > 0.0 ? 1.0 : 0.0;
  }
  float even = strengths / max(sending, 1.0);
  float all = 0.0;
  float lights = 0.0;
  float owner = 0.0;
  for (int i = 0; i < max(index + 1, own.first + own.owned); i++) {
    float strength = texelFetch(strength_tx, ivec2(i, 0), 0).r;
    float weight = strength > 0.0 ? strength + even : 0.0;
    all += i <= index ? weight : 0.0;
    lights += i <= index && i < pc_light_tiles ? weight : 0.0;
    owner += i >= own.first && i < own.first + own.owned ? weight : 0.0;
  }
  float strength = texelFetch(strength_tx, ivec2(index, 0), 0).r;
  out_tile = vec4(strength > 0.0 ? 1.0 + even / strength : 0.0, all, lights, owner);
}
