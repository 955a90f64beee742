#include "lib/instance_lib.glsl"

void main()
{
  Instance instance = instance_fetch(instance_tx, pc_first_instance + gl_InstanceID);
  vec4 world = instance.world_from_object * vec4(in_position, 1.0);
  v_position = world.xyz;
  v_normal = instance_normal(instance.world_from_object, in_normal);
  v_base_uv = in_base_uv;
  v_emission_uv = in_emission_uv;
  gl_Position = pc_clip_from_world * world;
}
