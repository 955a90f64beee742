#include "frame/material_corner_lib.glsl"
#include "frame/mesh_lib.glsl"

void main()
{
  MeshCorner corner = mesh_corner();
  Instance instance = instance_fetch(instance_tx, corner.instance);
  vec4 world = mesh_world(instance.world_from_object, corner.position);
  v_position = world.xyz;
  v_normal = instance_normal(instance.world_from_object, corner.normal);
  v_drawn = ivec4(corner.instance, corner.material, 0, instance.visibility);
#ifdef MATERIAL_GRAPH
  v_drawn.z = material_fetch(material_tx, corner.material).first_value;
#endif
#ifdef MATERIAL_OBJECT
  v_object_position = corner.position;
#endif
  material_corner(corner.on_page);
  gl_Position = mesh_clip(pc_clip_from_world, world);
#ifdef MAP_DEPTH
  v_depth = gl_Position.z;
#endif
}
