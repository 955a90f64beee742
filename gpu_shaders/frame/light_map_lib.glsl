/* Which face of which light holds a position: light_lib and map_lib together. */
#include "frame/light_lib.glsl"
#include "frame/map_lib.glsl"

/* Index of the face that answers for P. A sun's faces are ever wider ones: the first that holds P, or the last. */
int light_map_face(Light light, sampler2D face_tx, vec3 P)
{
  int last = light.first_face + light.face_count - 1;
  if (light.kind != LIGHT_SUN) {
    MapFace first = map_face_fetch(face_tx, light.first_face);
    return light.first_face + map_face_of(light.face_count, map_position(first, P));
  }
  for (int i = light.first_face; i < last; i++) {
    MapFace face = map_face_fetch(face_tx, i);
    if (map_holds(face, map_position(face, P))) {
      return i;
    }
  }
  return last;
}
