/* The place on a mesh that a fragment shows. */
#include "frame/material_lib.glsl"

MaterialPlace material_place(vec3 toward)
{
  MaterialPlace place;
  place.position = v_position;
  place.toward = toward;
  place.geometric = surface_geometric_normal(v_position, toward);
  place.normal = surface_shading_normal(v_normal, place.geometric);
  place.backfacing = dot(v_normal, place.geometric) < 0.0 ? 1.0 : 0.0;
#ifdef MATERIAL_OBJECT
  place.object_position = v_object_position;
  place.instance = v_instance;
#else
  place.object_position = v_position;
  place.instance = 0;
#endif
  return place;
}
