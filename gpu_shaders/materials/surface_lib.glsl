/* What a material is at a point, as every pass sees it; and the shader nodes, each reduced to it. All reflectances are
 * weighted already, so Mix and Add Shader are sums. */

struct MaterialSurface {
  vec3 diffuse;      /* diffuse reflectance */
  vec3 specular;     /* reflectance of the lobe at normal incidence; black: there is none */
  vec3 layer;        /* reflectance at normal incidence of what lies over the diffuse and refracting part */
  float roughness;   /* of that lobe, and of what is refracted */
  vec3 emission;     /* radiance, W/(m^2 sr) */
  vec3 transparent;  /* what passes straight on: 1 - alpha */
  vec3 transmission; /* what is refracted */
  float ior;         /* of what is refracted */
  float coat;        /* reflectance at normal incidence of a clear layer over all */
  float coat_roughness;
  vec3 normal; /* shading normal in the world */
};

/* What Schlick's Fresnel term adds to a black reflectance, averaged over all directions of even light. */
const float SURFACE_MEAN_FRESNEL = 1.0 / 21.0;
const float SURFACE_LARGEST_F0 = 0.98;
/* What sheen reflects of even light at its default roughness: it is added to the diffuse part, without its rim. */
const float SURFACE_SHEEN = 0.1;

MaterialSurface surface_black(vec3 normal)
{
  vec3 none = vec3(0.0);
  return MaterialSurface(none, none, none, 0.5, none, none, none, 1.0, 0.0, 0.0, normal);
}

float surface_mean(vec3 c)
{
  return (c.r + c.g + c.b) / 3.0;
}

/* What a layer can take from. */
float surface_under(MaterialSurface s)
{
  return surface_mean(s.diffuse + s.transmission);
}

/* Weighted sum; what has one value only is averaged by what each lobe reflects. */
MaterialSurface surface_sum(MaterialSurface a, float wa, MaterialSurface b, float wb)
{
  MaterialSurface s;
  s.diffuse = wa * a.diffuse + wb * b.diffuse;
  s.specular = wa * a.specular + wb * b.specular;
  float da = wa * surface_under(a), db = wb * surface_under(b);
  s.layer = da + db > 0.0 ? mix(a.layer, b.layer, db / (da + db)) : a.layer;
  s.emission = wa * a.emission + wb * b.emission;
  s.transparent = wa * a.transparent + wb * b.transparent;
  s.transmission = wa * a.transmission + wb * b.transmission;
  s.coat = wa * a.coat + wb * b.coat;
  float la = wa * surface_mean(a.specular + a.transmission), lb = wb * surface_mean(b.specular + b.transmission);
  s.roughness = la + lb > 0.0 ? mix(a.roughness, b.roughness, lb / (la + lb)) : a.roughness;
  float ta = wa * surface_mean(a.transmission), tb = wb * surface_mean(b.transmission);
  s.ior = ta + tb > 0.0 ? mix(a.ior, b.ior, tb / (ta + tb)) : a.ior;
  float ca = wa * a.coat, cb = wb * b.coat;
  s.coat_roughness = ca + cb > 0.0 ? mix(a.coat_roughness, b.coat_roughness, cb / (ca + cb)) : a.coat_roughness;
  float na = la + wa * surface_mean(a.diffuse) + ca, nb = lb + wb * surface_mean(b.diffuse) + cb;
  vec3 normal = na + nb > 0.0 ? na * a.normal + nb * b.normal : a.normal;
  float size = length(normal);
  s.normal = size > 1e-6 ? normal / size : a.normal;
  return s;
}

MaterialSurface surface_mix(MaterialSurface a, MaterialSurface b, float factor)
{
  float t = clamp(factor, 0.0, 1.0);
  return surface_sum(a, 1.0 - t, b, t);
}

MaterialSurface surface_add(MaterialSurface a, MaterialSurface b)
{
  return surface_sum(a, 1.0, b, 1.0);
}

MaterialSurface surface_diffuse(vec3 color, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  s.diffuse = color;
  return s;
}

MaterialSurface surface_emission(vec3 color, float strength, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  s.emission = color * strength;
  return s;
}

MaterialSurface surface_transparent(vec3 color, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  s.transparent = color;
  return s;
}

/* A Metallic BSDF's colour at normal incidence. */
MaterialSurface surface_metal(vec3 color, float roughness, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  s.specular = color;
  s.roughness = clamp(roughness, 0.0, 1.0);
  return s;
}

/* What a conductor of a complex IOR reflects at normal incidence. */
vec3 surface_conductor(vec3 ior, vec3 extinction)
{
  vec3 k = extinction * extinction, less = ior - 1.0, more = ior + 1.0;
  return (less * less + k) / max(more * more + k, 1e-6);
}

/* A Glossy BSDF knows no Fresnel term: a metal that reflects as much on average over all directions. */
MaterialSurface surface_glossy(vec3 color, float roughness, vec3 normal)
{
  return surface_metal(max((color - SURFACE_MEAN_FRESNEL) / (1.0 - SURFACE_MEAN_FRESNEL), 0.0), roughness, normal);
}

float surface_dielectric(float ior)
{
  ior = max(ior, 1e-3);
  float root = (ior - 1.0) / (ior + 1.0);
  return min(root * root, SURFACE_LARGEST_F0);
}

MaterialSurface surface_refraction(vec3 color, float roughness, float ior, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  s.transmission = color;
  s.roughness = clamp(roughness, 0.0, 1.0);
  s.ior = ior;
  return s;
}

MaterialSurface surface_glass(vec3 color, float roughness, float ior, vec3 normal)
{
  MaterialSurface s = surface_refraction(color, roughness, ior, normal);
  s.specular = color * surface_dielectric(ior);
  s.layer = s.specular;
  return s;
}

struct SurfacePrincipled {
  vec3 base;
  float metallic;
  float roughness;
  float ior;
  float level;
  vec3 tint;
  float transmission;
  float alpha;
};

/* Subsurface scattering is diffuse. */
MaterialSurface surface_principled(SurfacePrincipled p, vec3 normal)
{
  MaterialSurface s = surface_black(normal);
  float metallic = clamp(p.metallic, 0.0, 1.0), transmission = clamp(p.transmission, 0.0, 1.0);
  float alpha = clamp(p.alpha, 0.0, 1.0);
  float f0 = min(surface_dielectric(p.ior) * 2.0 * max(p.level, 0.0), SURFACE_LARGEST_F0);
  vec3 layer = clamp(f0 * max(p.tint, 0.0), 0.0, 1.0);
  vec3 base = max(p.base, 0.0);
  s.diffuse = base * (alpha * (1.0 - metallic) * (1.0 - transmission));
  s.specular = alpha * mix(layer, base, metallic);
  s.layer = layer;
  s.roughness = clamp(p.roughness, 0.0, 1.0);
  s.transmission = base * (alpha * (1.0 - metallic) * transmission);
  s.ior = p.ior;
  s.transparent = vec3(1.0 - alpha);
  return s;
}

/* What lies over a Principled BSDF's surface or comes out of it, `alpha` of it. */
MaterialSurface surface_over(MaterialSurface s, float alpha, vec3 emission, vec3 sheen, float coat, float coat_ior,
                             float coat_roughness)
{
  alpha = clamp(alpha, 0.0, 1.0);
  s.emission = alpha * emission;
  vec3 added = SURFACE_SHEEN * clamp(sheen, 0.0, 1.0);
  /* Sheen lies over the rest and leaves it less, by its greatest channel. */
  float left = 1.0 - max(added.r, max(added.g, added.b));
  s.diffuse = left * s.diffuse + alpha * added;
  s.specular *= left;
  s.coat = alpha * clamp(coat, 0.0, 1.0) * surface_dielectric(coat_ior);
  s.coat_roughness = clamp(coat_roughness, 0.0, 1.0);
  return s;
}

/* EEVEE's Specular BSDF: `specular` is the reflectance at normal incidence. */
MaterialSurface surface_specular(vec3 base, vec3 specular, float roughness, vec3 emission, float transparency,
                                 vec3 normal, float coat, float coat_roughness)
{
  MaterialSurface s = surface_black(normal);
  float alpha = 1.0 - clamp(transparency, 0.0, 1.0);
  s.diffuse = alpha * max(base, 0.0);
  s.specular = alpha * clamp(specular, 0.0, 1.0);
  s.layer = s.specular;
  s.roughness = clamp(roughness, 0.0, 1.0);
  s.emission = alpha * emission;
  s.transparent = vec3(1.0 - alpha);
  s.coat = alpha * clamp(coat, 0.0, 1.0) * surface_dielectric(1.5);
  s.coat_roughness = clamp(coat_roughness, 0.0, 1.0);
  return s;
}
