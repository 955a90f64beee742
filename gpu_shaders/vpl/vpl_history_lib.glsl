/* What a surface had in the picture before: means over the texels around its place there that show the same surface. */
#include "vpl/vpl_strength_lib.glsl"
#include "vpl/vpl_surface_lib.glsl"

/* Of the four texels around a place, those that agree less than this in all know nothing of it. */
const float HISTORY_LEAST = 0.02;
/* Means of fewer samples than this do not know their variance. */
const float HISTORY_FEW = 4.0;
/* A place of what was in no picture before. */
const vec2 HISTORY_NOWHERE = vec2(-8.0);

struct HistoryTaps {
  ivec2 lower;
  vec4 shares; /* of the texels at lower + (0 0, 1 0, 0 1, 1 1); all zero: there is no history */
};

/* A `place` outside the picture has none. Lavapipe crashes where a texture is first read in a loop that only some pixels
 * go through: all call these, and all read. */
HistoryTaps history_taps(sampler2D old_surface_tx, vec2 place, Gatherer at)
{
  HistoryTaps taps = HistoryTaps(ivec2(floor(place)), vec4(0.0));
  vec2 part = place - vec2(taps.lower);
  ivec2 size = textureSize(old_surface_tx, 0);
  for (int i = 0; i < 4; i++) {
    ivec2 corner = ivec2(i & 1, i >> 1);
    ivec2 texel = taps.lower + corner;
    ivec2 inside = clamp(texel, ivec2(0), size - 1);
    Gatherer old = surface_unpack(texelFetch(old_surface_tx, inside, 0));
    vec2 near = mix(1.0 - part, part, vec2(corner)) + 1e-3;
    float weight = inside == texel && old.exists ? near.x * near.y * surface_alike(at, old) : 0.0;
    taps.shares[i] = weight > 1e-3 ? weight : 0.0;
  }
  float sum = dot(taps.shares, vec4(1.0));
  taps.shares = sum > HISTORY_LEAST ? taps.shares / sum : vec4(0.0);
  return taps;
}

vec4 history_mean(HistoryTaps taps, sampler2D history_tx)
{
  vec4 sum = vec4(0.0);
  ivec2 last = textureSize(history_tx, 0) - 1;
  for (int i = 0; i < 4; i++) {
    vec4 texel = texelFetch(history_tx, clamp(taps.lower + ivec2(i & 1, i >> 1), ivec2(0), last), 0);
    sum += taps.shares[i] > 0.0 ? taps.shares[i] * texel : vec4(0.0);
  }
  return sum;
}

/* A mean with its newest sample in it. */
struct HistoryJoined {
  vec3 mean;
  float samples;  /* that it stands for */
  float moment;   /* mean of the squared strength */
  float variance; /* of the mean's strength; means nothing where `samples` are below HISTORY_FEW */
};

/* `history`: the mean before and how many samples it stands for, of which at most `most` count. */
HistoryJoined history_joined(vec4 history, float moment, vec3 light, float most)
{
  HistoryJoined joined;
  joined.samples = min(history.w, most) + 1.0;
  joined.mean = mix(history.rgb, light, 1.0 / joined.samples);
  float strength = vpl_strength(light);
  joined.moment = mix(moment, strength * strength, 1.0 / joined.samples);
  float level = vpl_strength(joined.mean);
  joined.variance = max(joined.moment - level * level, 0.0) / max(joined.samples - 1.0, 1.0);
  return joined;
}
