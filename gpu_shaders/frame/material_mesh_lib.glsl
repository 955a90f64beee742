/* The place on a mesh that a fragment shows, and its surface. */
#include "frame/material_lib.glsl"
#ifdef MATERIAL_PASSES
#include "frame/material_dither_lib.glsl"
#endif

MaterialPlace material_place(vec3 toward)
{
  MaterialPlace place;
  place.position = v_position;
  place.toward = toward;
  place.geometric = surface_geometric_normal(v_position, toward);
  place.normal = surface_shading_normal(v_normal, place.geometric);
  place.backfacing = dot(v_normal, place.geometric) < 0.0 ? 1.0 : 0.0;
  place.instance = v_drawn.x;
#ifdef MATERIAL_OBJECT
  place.object_position = v_object_position;
#else
  place.object_position = v_position;
#endif
  return place;
}

/* As it looks from the viewer's side. */
Surface material_seen(inout MaterialPlace place)
{
  Surface surface = material_evaluate(place);
  return surface_toward(surface, dot(place.normal, place.toward));
}

/* The same as it is drawn: no fragment where it lets this sample pass, or on a back that is culled. */
Surface material_drawn(inout MaterialPlace place)
{
  Surface surface = material_seen(place);
#ifdef MATERIAL_CULLS
  if (place.backfacing > 0.5) {
    discard;
  }
#endif
#ifdef MATERIAL_PASSES
  if (material_is_passed(surface.coverage)) {
    discard;
  }
  surface = surface_drawn(surface);
#endif
  return surface;
}
