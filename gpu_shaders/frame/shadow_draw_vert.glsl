#include "frame/mesh_lib.glsl"

void main()
{
  MeshCorner corner = mesh_corner();
  Instance instance = instance_fetch(instance_tx, corner.instance);
  vec4 world = mesh_world(instance.world_from_object, corner.position);
  gl_Position = mesh_clip(pc_clip_from_world, world);
  /* Orthographic maps carry their depth here; in perspective gl_FragCoord.w is 1 / z already. */
  v_depth = gl_Position.z;
}
