/* A sample of what glossy surfaces reflect joins the mean of what they reflected before, all over the lobe's albedo. What
 * a mirror shows does not move with its surface: the sharper a lobe, the less counts what was seen from elsewhere. */
#include "vpl/vpl_history_lib.glsl"

/* The deviation of means of few samples, as a part of their level, at this roughness; it grows with the width of the lobe's
 * highlight, so that the filter mixes what wide lobes show, and leaves mirrors alone. */
const float REFLECT_ROUGHNESS = 0.1;
const float REFLECT_UNKNOWN = 1e4;
/* Lobes of at least this roughness show the same from a little aside. */
const float REFLECT_STEADY = 0.4;

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  out_history = vec4(0.0);
  out_noisy = vec4(0.0);
  out_direct = vec4(0.0);
  Gatherer at = surface_unpack(texelFetch(surface_tx, texel, 0));
  if (!at.exists) {
    return;
  }
  vec4 indirect = texelFetch(indirect_tx, texel, 0);
  vec3 direct = texelFetch(direct_tx, texel, 0).rgb;
  vec3 light = indirect.rgb + direct;
  float roughness = indirect.w;

  vec4 clip = old_view.clip_from_world * vec4(at.P, 1.0);
  vec2 pixel = (0.5 + 0.5 * clip.xy / clip.w) * old_view.size - 0.5;
  vec2 place = (pixel - old_view.offset) / old_view.stride;
  /* Between texels it would be blurred once more in every sample of a still view, without end. */
  place = pc_still != 0 ? floor(place + 0.5) : place;
  place = clip.w > 0.0 && pc_most_history > 0.0 ? place : HISTORY_NOWHERE;
  HistoryTaps taps = history_taps(old_surface_tx, place, at);
  vec4 history = history_mean(taps, history_tx);
  vec4 direct_history = history_mean(taps, direct_history_tx);
  float most = pc_still != 0 ? pc_most_history : pc_most_history * smoothstep(0.0, REFLECT_STEADY, roughness);
  HistoryJoined joined = history_joined(history, direct_history.w, light, most);
  float variance = joined.variance;
  if (joined.samples < HISTORY_FEW) {
    float level = vpl_strength(joined.mean), width = roughness / REFLECT_ROUGHNESS;
    variance = level * level * min(width * width * width * width, REFLECT_UNKNOWN);
  }
  out_history = vec4(joined.mean, joined.samples);
  out_noisy = vec4(joined.mean, variance);
  out_direct = vec4(mix(direct_history.rgb, direct, 1.0 / joined.samples), joined.moment);
}
