void main()
{
  Instance instance = instance_fetch(instance_tx, pc_first_instance + gl_InstanceID);
  vec4 world = instance.world_from_object * vec4(in_position, 1.0);
  gl_Position = pc_clip_from_world * world;
  /* Orthographic maps carry their depth here; in perspective gl_FragCoord.w is 1 / z already. */
  v_depth = gl_Position.z;
}
