/* A virtual point light (Keller, "Instant Radiosity", 1997), and reservoirs of them (Bitterli et al. 2020, "Spatiotemporal
 * reservoir resampling for real-time ray tracing with dynamic direct lighting"). SOURCE_BOUNCE ... SOURCE_SKY, what a light
 * stands for, are defines (frame/reflective_shaders.py). */
#include "lib/math_lib.glsl"
#include "lib/octahedron_lib.glsl"
#include "vpl/vpl_strength_lib.glsl"

struct Vpl {
  vec3 position;
  float area; /* m² that it stands for */
  vec3 normal;
  vec3 flux;     /* W, that leaves it diffusely */
  vec4 specular; /* W, incident light times specular reflectance; its lobe (lobe_lib.glsl) */
  float counts;  /* how much of it counts where lights are chosen by strength */
  int id;        /* its texel in the atlas and its kind; 0: none */
};

const Vpl VPL_NONE = Vpl(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), vec4(0.0), 0.0, 0);

/* Texels of the atlas are below 8192. Kinds are below 31, so that no id is a NaN's bits. */
int vpl_id(ivec2 texel, int kind)
{
  return texel.x | (texel.y << 13) | (kind << 26);
}

ivec2 vpl_id_texel(int id)
{
  return ivec2(id & 8191, (id >> 13) & 8191);
}

int vpl_id_kind(int id)
{
  return id >> 26;
}

Vpl vpl_of_texel(sampler2D position_area_tx, sampler2D normal_kind_tx, sampler2D flux_tx, sampler2D specular_tx, int id)
{
  ivec2 texel = vpl_id_texel(id);
  vec4 place = texelFetch(position_area_tx, texel, 0);
  vec4 flux = texelFetch(flux_tx, texel, 0);
  vec4 specular = vec4(0.0);
#ifdef GLOSSY
  /* The cache keeps its points' reflectance there. */
  if (vpl_id_kind(id) == SOURCE_BOUNCE) {
    specular = texelFetch(specular_tx, texel, 0);
  }
#endif
  return Vpl(place.xyz, place.w, texelFetch(normal_kind_tx, texel, 0).xyz, flux.rgb, specular, flux.w, id);
}

/* One light out of many candidates: `weight` estimates 1 / the probability of `id`, from `seen` candidates. */
struct Reservoir {
  int id;
  float sum;    /* of the candidates' weights */
  float target; /* strength of the chosen one's light at the receiver */
  float seen;
};

/* Offer a candidate. `u` in [0, 1) is a random number that stays one: each choice uses up its bits and rescales it. */
void reservoir_offer(inout Reservoir r, int id, float weight, float target, inout float u)
{
  if (weight <= 0.0) {
    return;
  }
  r.sum += weight;
  float part = weight / r.sum;
  if (u < part) {
    r.id = id;
    r.target = target;
    u /= part;
  } else {
    u = (u - part) / max(1.0 - part, 1e-7);
  }
  u = clamp(u, 0.0, 0.99999994);
}
