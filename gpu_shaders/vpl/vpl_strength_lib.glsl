/* How strong a light is: what virtual point lights are chosen in proportion to. The plain mean of the channels: a deep
 * blue lamp is not to be noisier than a green one. */

/* Components of a tile's running sums (vpl_tiles_frag.glsl). */
const int VPL_SUM_ALL = 1;
const int VPL_SUM_LIGHTS = 2;

float vpl_strength(vec3 light)
{
  return (light.r + light.g + light.b) * (1.0 / 3.0);
}

float vpl_texel_strength(sampler2D flux_tx, sampler2D specular_tx, ivec2 texel)
{
  vec4 flux = texelFetch(flux_tx, texel, 0);
  return flux.w * (vpl_strength(flux.rgb) + vpl_strength(texelFetch(specular_tx, texel, 0).rgb));
}

/* The first of so many tiles at which one component of the running sums is above `wanted`; the last if none is. */
int vpl_tile_above(sampler2D sums_tx, int tiles, int component, float wanted)
{
  int low = 0;
  int high = tiles - 1;
  while (low < high) {
    int middle = (low + high) / 2;
    if (texelFetch(sums_tx, ivec2(middle, 0), 0)[component] > wanted) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}
