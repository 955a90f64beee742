/* Image lookups with the wrap and filter of the material, done by hand: Blender 4.5 and 5.0 cannot set them on a
 * texture. `mode` holds the bits IMAGE_CLOSEST and IMAGE_EXTEND (frame/structs.py). */

/* `texel` is at least -size. */
ivec2 image_wrap(ivec2 texel, ivec2 size, int mode)
{
  if ((mode & IMAGE_EXTEND) != 0) {
    return clamp(texel, ivec2(0), size - 1);
  }
  return (texel + size) % size;
}

vec4 image_sample(sampler2D image_tx, vec2 uv, int mode)
{
  ivec2 size = textureSize(image_tx, 0);
  if ((mode & IMAGE_EXTEND) == 0) {
    uv = fract(uv);
  }
  vec2 place = clamp(uv, vec2(-1.0), vec2(2.0)) * vec2(size);
  if ((mode & IMAGE_CLOSEST) != 0) {
    return texelFetch(image_tx, image_wrap(ivec2(floor(place)), size, mode), 0);
  }
  place -= 0.5;
  ivec2 lower = ivec2(floor(place));
  vec2 part = place - vec2(lower);
  vec4 a = texelFetch(image_tx, image_wrap(lower, size, mode), 0);
  vec4 b = texelFetch(image_tx, image_wrap(lower + ivec2(1, 0), size, mode), 0);
  vec4 c = texelFetch(image_tx, image_wrap(lower + ivec2(0, 1), size, mode), 0);
  vec4 d = texelFetch(image_tx, image_wrap(lower + ivec2(1, 1), size, mode), 0);
  return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}
