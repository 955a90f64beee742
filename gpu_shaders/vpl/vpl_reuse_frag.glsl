/* Spatiotemporal reuse (Bitterli et al. 2020): this sample's reservoir, the one that the surface had in the picture before
 * and some of its neighbours there become one, weighted by the candidates they stand for on surfaces where the chosen
 * light shines at all. The result joins the mean of the light that the surface had before. */
#include "lib/sampling_lib.glsl"
#include "vpl/vpl_form_lib.glsl"
#include "vpl/vpl_history_lib.glsl"
#include "vpl/vpl_reach_lib.glsl"

/* How far away neighbours' reservoirs are asked, in texels. */
const float REUSE_RADIUS = 6.0;
/* Neighbours less alike than this give nothing. */
const float REUSE_ALIKE = 0.5;
/* Apart from the seeds of the candidates. */
const int REUSE_SEED = 1024;
/* The variance of means of few samples is taken for this, so that only surfaces keep the filter from mixing. */
const float REUSE_UNKNOWN = 1e12;

struct Source {
  Gatherer surface;
  float seen;
};

/* Offer what a surface stored; `seen`: the candidates that it stands for. */
Source reuse_offer(inout Reservoir r, Gatherer surface, vec4 stored, float seen, Gatherer at, inout float u)
{
  r.seen += seen;
  int id = floatBitsToInt(stored.x);
  if (id != 0 && stored.y > 0.0) {
    Vpl vpl = vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, id);
    float target = vpl_strength(vpl_light(vpl, at.P, at.N));
    reservoir_offer(r, id, target * stored.y * seen, target, u);
  }
  return Source(surface, seen);
}

/* Offer what the surface, number 0, or a neighbour around `place` had in the picture before, where it is alike. */
Source reuse_before(inout Reservoir r, int number, vec2 place, vec2 noise, Gatherer at, inout float u)
{
  float angle = 2.0 * MATH_PI * fract(noise.y + float(number) * 0.618034);
  float radius = number == 0 ? 0.0 : REUSE_RADIUS * sqrt(fract(noise.x + float(number) * 0.754878));
  ivec2 from = ivec2(floor(place + 0.5 + radius * vec2(cos(angle), sin(angle))));
  if (any(lessThan(from, ivec2(0))) || any(greaterThanEqual(from, textureSize(history_tx, 0)))) {
    return Source(at, 0.0);
  }
  Gatherer old = surface_unpack(texelFetch(old_surface_tx, from, 0));
  vec4 stored = texelFetch(old_reservoir_tx, from, 0);
  bool alike = old.exists && surface_alike(at, old) > REUSE_ALIKE;
  return reuse_offer(r, old, stored, alike ? min(stored.z, pc_most_reuse) : 0.0, at, u);
}

/* The candidates of a source, if it could have chosen the light. */
float reuse_able(Source source, Vpl vpl)
{
  return vpl_form(vpl.position, vpl.area, vpl.normal, source.surface.P, source.surface.N) > 0.0 ? source.seen : 0.0;
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  out_reservoir = vec4(0.0);
  out_history = vec4(0.0);
  out_noisy = vec4(0.0);
#ifdef FIRST_HAND
  out_direct = vec4(0.0);
#endif
  Gatherer at = surface_unpack(texelFetch(surface_tx, texel, 0));
  if (!at.exists) {
    return;
  }
  vec4 clip = old_view.clip_from_world * vec4(at.P, 1.0);
  vec2 pixel = (0.5 + 0.5 * clip.xy / clip.w) * old_view.size - 0.5;
  vec2 place = (pixel - old_view.offset) / old_view.stride;
  bool before = clip.w > 0.0 && pc_most_history > 0.0;

  vec4 own = texelFetch(reservoir_tx, texel, 0);
  vec2 noise = sampling_r2(vpl_frame.number, sampling_hash(texel, vpl_frame.seed + REUSE_SEED));
  float u = noise.x;
  Reservoir r = Reservoir(0, 0.0, 0.0, 0.0);
  Source now = reuse_offer(r, at, own, 1.0, at, u);
  Source here = Source(at, 0.0);
  Source one = here;
  Source other = here;
  if (before && pc_most_reuse > 0.0) {
    here = reuse_before(r, 0, place, noise, at, u);
    one = reuse_before(r, 1, place, noise, at, u);
    other = reuse_before(r, 2, place, noise, at, u);
  }
  vec3 light = texelFetch(rest_tx, texel, 0).rgb;
  vec3 direct = vec3(0.0);
#ifdef FIRST_HAND
  direct = texelFetch(emitted_tx, texel, 0).rgb;
#endif
  float weight = 0.0;
  if (r.id != 0) {
    Vpl vpl = vpl_of_texel(position_area_tx, normal_kind_tx, flux_tx, specular_tx, r.id);
    float able = reuse_able(now, vpl) + reuse_able(here, vpl) + reuse_able(one, vpl) + reuse_able(other, vpl);
    weight = r.sum / max(able * r.target, 1e-30);
    bool own_choice = r.id == floatBitsToInt(own.x);
    if (!own_choice && !reach_sees(at.P, voxel_start_seen(at.P, at.N, math_toward(at.P, vpl_frame.eye)), vpl)) {
      weight = 0.0;
    }
    vec3 chosen = vpl_light(vpl, at.P, at.N) * weight;
    int kind = vpl_id_kind(r.id);
    light += chosen;
    direct += kind == SOURCE_EMISSION || kind == SOURCE_SKY ? chosen : vec3(0.0);
  }

  HistoryTaps taps = history_taps(old_surface_tx, before ? place : HISTORY_NOWHERE, at);
  vec4 history = history_mean(taps, history_tx);
  HistoryJoined joined = history_joined(history, history_mean(taps, old_reservoir_tx).w, light, pc_most_history);
  out_reservoir = vec4(intBitsToFloat(r.id), weight, r.seen, joined.moment);
  out_history = vec4(joined.mean, joined.samples);
  out_noisy = vec4(joined.mean, joined.samples < HISTORY_FEW ? REUSE_UNKNOWN : joined.variance);
#ifdef FIRST_HAND
  out_direct = vec4(mix(history_mean(taps, direct_history_tx).rgb, direct, 1.0 / joined.samples), 0.0);
#endif
}
