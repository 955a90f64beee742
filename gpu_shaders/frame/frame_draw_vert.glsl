#include "frame/material_corner_lib.glsl"
#include "lib/instance_lib.glsl"

void main()
{
  int row = pc_first_instance + gl_InstanceID;
  Instance instance = instance_fetch(instance_tx, row);
  vec4 world = instance.world_from_object * vec4(in_position, 1.0);
  v_position = world.xyz;
  v_normal = instance_normal(instance.world_from_object, in_normal);
#ifdef MATERIAL_OBJECT
  v_object_position = in_position;
  v_instance = row;
#endif
  material_corner();
  gl_Position = pc_clip_from_world * world;
#ifdef MAP_DEPTH
  v_depth = gl_Position.z;
#endif
}
