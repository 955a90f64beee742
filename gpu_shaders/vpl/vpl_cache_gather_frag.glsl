/* Some rounds of gathering at one point of the cache: irradiance / pi from the pool, and their number; and the
 * part of it that came from the sky, which baked objects have already. */
#include "vpl/vpl_candidates_lib.glsl"

/* Where the points' noise begins, beyond any picture's pixels. */
const ivec2 CACHE_PIXEL = ivec2(1 << 20, 0);
/* What a point keeps of light that is not asked for: enough to know that it is not inside of things. A dark corner whose
 * rays found no light yet would else not answer, and brighter places in its stead. */
const vec3 CACHE_LEAST = vec3(1e-30);

void main()
{
  ivec2 point = ivec2(gl_FragCoord.xy);
  ivec2 texel = point + pc_origin;
  out_sum = vec4(0.0);
  out_sky = vec4(0.0);
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec3 N = texelFetch(normal_kind_tx, texel, 0).xyz;
  if (place.w == 0.0) {
    return;
  }
  vec3 origin = voxel_start_seen(place.xyz, N, N);
  int i = 0;
  do {
    bool visible;
    vec3 carried;
    vec3 from_sky;
    vec3 emitted;
    Reservoir r = candidates_choose(place.xyz, N, N, origin, point + CACHE_PIXEL, i, vpl_frame.kinds, visible, carried,
                                    from_sky, emitted);
    vec3 light = candidates_light(r, visible, place.xyz, N, origin);
    float further = float(vpl_frame.kinds >> SOURCE_CACHE & 1);
    out_sum += vec4(light + emitted + (further > 0.0 ? carried : min(carried, CACHE_LEAST)), 1.0);
    bool is_sky = r.id != 0 && vpl_id_kind(r.id) == SOURCE_SKY;
    out_sky += vec4((is_sky ? light : vec3(0.0)) + further * from_sky, 1.0);
    i++;
  } while (i < pc_rounds);
}
