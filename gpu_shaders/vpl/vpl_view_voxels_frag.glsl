/* The voxels as the camera sees them, each in a grey of its own, darker with distance. */
#include "frame/voxel_lib.glsl"
#include "lib/sampling_lib.glsl"

void main()
{
  vec2 place = 2.0 * uv - 1.0;
  vec4 near = pc_world_from_clip * vec4(place, -1.0, 1.0);
  vec4 far = pc_world_from_clip * vec4(place, 1.0, 1.0);
  vec3 origin = near.xyz / near.w;
  vec3 direction = normalize(far.xyz / far.w - origin);
  float reach = voxel_trace(origin, direction, 1e30);
  out_color = vec4(0.0, 0.0, 0.0, 1.0);
  if (reach < 0.0) {
    return;
  }
  vec3 hit = origin + (reach + 0.01 * voxel_grid.edge) * direction;
  VoxelPlace grid = voxel_place_at(hit);
  ivec3 voxel = ivec3(floor((hit - grid.origin) / grid.edge));
  float grey = 0.5 + 0.5 * sampling_hash(voxel.xy, voxel.z).x;
  float size = voxel_grid.edge * max(voxel_grid.size.x, max(voxel_grid.size.y, voxel_grid.size.z));
  out_color.rgb = vec3(grey * size / (size + reach));
}
