/* One face of a light's map: a square perspective or orthographic picture of the scene from the light, kept as a tile
 * of an atlas. "Closeness" c grows toward the light and is linear over the tile for every plane of the scene:
 * far / z in perspective, -z / far in orthographic projection. */

vec3 map_position(MapFace face, vec3 P)
{
  return (face.face_from_world * vec4(P, 1.0)).xyz;
}

/* Tile coordinates, [0, 1] inside the tile. */
vec2 map_uv(MapFace face, vec3 p)
{
  return 0.5 + 0.5 * face.scale * (face.perspective != 0 ? p.xy / p.z : p.xy);
}

/* Whether the position p (in the face's frame) has a place in the map. */
bool map_holds(MapFace face, vec3 p)
{
  if (face.perspective != 0 && p.z <= face.near) {
    return false;
  }
  vec2 uv = map_uv(face, p);
  return all(greaterThanEqual(uv, vec2(0.0))) && all(lessThan(uv, vec2(1.0)));
}

/* Closeness at tile coordinates `uv` of the plane through p with normal n (both in the face's frame). */
float map_plane_closeness(MapFace face, vec3 p, vec3 n, vec2 uv)
{
  vec2 xy = (2.0 * uv - 1.0) / face.scale;
  if (face.perspective != 0) {
    return face.far * dot(n, vec3(xy, 1.0)) / dot(n, p);
  }
  return -(dot(n, p) - dot(n.xy, xy)) / (n.z * face.far);
}

/* Depths of perspective maps, z / far, are kept by the bits of that float: nearly its logarithm, so near and far are held
 * equally well, and the same on every GPU. MAP_NEAR_BITS and MAP_FAR_BITS are defines (frame/structs.py). */
float map_depth(float part_of_far)
{
  int bits = floatBitsToInt(part_of_far) - MAP_NEAR_BITS;
  return clamp(float(bits) / float(MAP_FAR_BITS - MAP_NEAR_BITS), 0.0, 1.0);
}

/* Closeness of what a map holds as its depth. */
float map_closeness(MapFace face, float depth)
{
  if (face.perspective == 0) {
    return -depth;
  }
  return 1.0 / intBitsToFloat(MAP_NEAR_BITS + int(depth * float(MAP_FAR_BITS - MAP_NEAR_BITS) + 0.5));
}

/* Which of a light's faces looks toward the position p in the frame of its first. One is all there is; five are the half
 * cube around it in the order -Z +X -X +Y -Y of the light's frame (maps.py), six the whole cube with +Z last. */
int map_face_of(int face_count, vec3 p)
{
  if (face_count == 1) {
    return 0;
  }
  vec3 a = abs(p);
  if (a.z >= max(a.x, a.y)) {
    return p.z > 0.0 ? 0 : face_count - 1;
  }
  return a.x >= a.y ? (p.x > 0.0 ? 1 : 2) : (p.y > 0.0 ? 3 : 4);
}
