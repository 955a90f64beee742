/* A surface as the frame lights it, and the place on it that a material is asked about. */
#include "lib/bxdf_lib.glsl"

struct Surface {
  vec3 albedo;   /* diffuse reflectance, 0..1 */
  vec3 specular; /* specular reflectance at normal incidence; black where there is no lobe */
  float roughness;
  vec3 emission;     /* radiance, W/(m^2 sr) */
  vec3 diffuse;      /* diffuse reflectance without the layer over it */
  vec3 layer;        /* specular reflectance of that layer at normal incidence */
  vec3 transparent;  /* what passes straight on */
  vec3 transmission; /* what passes on of what the lobe leaves */
  float coverage;    /* 0..1: of light that does not pass on */
  vec3 passing;      /* what passes on, in all */
};

/* A surface that lets everything pass and yet sends light, as Add Shader makes it, is met all the same, in so many
 * samples or as many as it reflects: what it sends is right on average, and what is behind it loses that part. */
const float SURFACE_NO_COVERAGE = 0.01;
const float SURFACE_ADDED_COVERAGE = 0.125;

struct MaterialPlace {
  vec3 position;
  vec3 normal;    /* unit, shading, on the viewer's side; material_evaluate() bends it */
  vec3 geometric; /* unit, on the viewer's side */
  vec3 toward;    /* unit, to the viewer */
  vec3 object_position;
  int instance;
  float backfacing;
};

/* The surface seen from a direction of this cosine to the shading normal: the layer takes from the diffuse part what it
 * reflects itself, as Cycles layers them: by its greatest channel. */
Surface surface_toward(Surface surface, float cosine)
{
  vec3 taken = vec3(0.0);
  if (surface.layer != vec3(0.0)) {
    taken = bxdf_albedo(surface.layer, surface.roughness, cosine);
  }
  float left = 1.0 - max(taken.r, max(taken.g, taken.b));
  surface.albedo = surface.diffuse * left;
  surface.passing = surface.transparent + surface.transmission * left;
  surface.coverage = 1.0 - clamp((surface.passing.r + surface.passing.g + surface.passing.b) / 3.0, 0.0, 1.0);
  vec3 kept = surface.albedo + surface.specular;
  float most = max(kept.r, max(kept.g, kept.b));
  if (surface.coverage < SURFACE_NO_COVERAGE && (surface.emission != vec3(0.0) || most > SURFACE_NO_COVERAGE)) {
    surface.coverage = clamp(most, SURFACE_ADDED_COVERAGE, 1.0);
  }
  return surface;
}

/* What is drawn in one sample of several stands for those in which the surface let everything pass. */
Surface surface_drawn(Surface surface)
{
  if (surface.coverage < 1.0) {
    float often = 1.0 / max(surface.coverage, 1e-3);
    surface.albedo = min(surface.albedo * often, vec3(1.0));
    surface.specular = min(surface.specular * often, vec3(1.0));
    surface.emission *= often;
  }
  return surface;
}

/* The unit normal of the triangle itself, on the side of `eye_direction` (from the surface to the viewer). */
vec3 surface_geometric_normal(vec3 P, vec3 eye_direction)
{
  vec3 n = cross(dFdx(P), dFdy(P));
  float size = length(n);
  n = size > 0.0 ? n / size : eye_direction;
  return dot(n, eye_direction) < 0.0 ? -n : n;
}

/* The shading normal on the viewer's side; the geometric one where the mesh's own is degenerate. */
vec3 surface_shading_normal(vec3 normal, vec3 geometric)
{
  float size = length(normal);
  vec3 n = size > 1e-20 ? normal / size : geometric;
  return dot(n, geometric) < 0.0 ? -n : n;
}
