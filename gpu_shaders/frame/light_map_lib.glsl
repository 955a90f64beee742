/* Which face of which light holds a position: light_lib and map_lib together. */
#include "frame/light_lib.glsl"
#include "frame/map_lib.glsl"

/* The face that answers for P, and its index. A sun's faces are ever wider ones: the first that holds P, or the last. Others
 * look around the light: the first one's frame tells which looks toward P. */
MapFace light_map_face(Light light, sampler2D face_tx, vec3 P, out int index)
{
  int last = light.first_face + light.face_count - 1;
  int next = light.first_face;
  MapFace face;
  do {
    index = next;
    face = map_face_fetch(face_tx, index);
    vec3 p = map_position(face, P);
    if (light.kind == LIGHT_SUN) {
      next = index < last && !map_holds(face, p) ? index + 1 : index;
    } else if (index == light.first_face) {
      next = index + map_face_of(light.face_count, p);
    }
  } while (next != index);
  return face;
}
