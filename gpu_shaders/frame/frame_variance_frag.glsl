/* The standard error of the mean luminance as a part of that mean: black 0.1 %, blue 1 %, green 10 %, red 100 %. */
const vec3 VARIANCE_UNKNOWN = vec3(0.2);

void main()
{
  vec2 moments = texelFetch(moments_tx, ivec2(gl_FragCoord.xy), 0).rg;
  float mean = moments.x / pc_samples;
  vec3 color = VARIANCE_UNKNOWN;
  if (pc_samples > 1.5) {
    float variance = max(moments.y - pc_samples * mean * mean, 0.0) / (pc_samples - 1.0);
    float relative = mean > 0.0 ? sqrt(variance / pc_samples) / mean : 0.0;
    float place = clamp(log2(max(relative, 1e-6) * 1e3) / log2(10.0), 0.0, 3.0);
    vec3 blue = vec3(0.0, 0.0, 1.0);
    vec3 green = vec3(0.0, 1.0, 0.0);
    color = place < 1.0   ? place * blue
            : place < 2.0 ? mix(blue, green, place - 1.0)
                          : mix(green, vec3(1.0, 0.0, 0.0), place - 2.0);
  }
  /* Sums are shown: of so many samples. */
  out_color = vec4(color, 1.0) * pc_samples;
}
