/* Where a corner of a mesh lies, for all passes that compare their depths with one another's: the same bits in each.
 * (`invariant gl_Position` is refused on Vulkan, where Blender's own code uses it before.) */
#ifdef GPU_METAL
#define MESH_EXACT
#else
#define MESH_EXACT precise
#endif

vec4 mesh_world(mat4 world_from_object, vec3 position)
{
  MESH_EXACT vec4 world = world_from_object[0] * position.x + world_from_object[1] * position.y +
                          world_from_object[2] * position.z + world_from_object[3];
  return world;
}

vec4 mesh_clip(mat4 clip_from_world, vec4 world)
{
  MESH_EXACT vec4 clip = clip_from_world[0] * world.x + clip_from_world[1] * world.y + clip_from_world[2] * world.z +
                         clip_from_world[3] * world.w;
  return clip;
}
