/* The corner that a vertex of a draw stands for (batches.py). Chunks are rows of chunk_tx: first triangle on the page,
 * triangles, row of the instance, material. */
#include "frame/mesh_place_lib.glsl"
#include "lib/instance_lib.glsl"
#include "lib/octahedron_lib.glsl"

struct MeshCorner {
  vec3 position; /* object space */
  vec3 normal;
  int on_page; /* number of the corner */
  int instance;
  int material;
};

ivec2 mesh_texel(int on_page)
{
  return ivec2(on_page & (MESH_PAGE_WIDTH - 1), int(uint(on_page) / uint(MESH_PAGE_WIDTH)));
}

/* The inverse of mesh_pages.pack_normals(). */
vec3 mesh_normal(float stored)
{
  uint bits = floatBitsToUint(stored);
  uvec2 numbers = uvec2(bits & 0x7FFFu, ((bits >> 15) & 0x3FFFu) | ((bits >> 31) << 14));
  return bits == 0u ? vec3(0.0) : octahedron_decode(vec2(numbers) / 16383.0 - 1.0);
}

/* A third of a number, rounded down: where integers are divided one by one, as in software, it is half of the work. Beyond
 * 2^24 a float is some numbers off, which the second line mends: 10923 is half a third of 65536, so that what is below a
 * multiple of 3 and what is above go the right way. */
int mesh_third(int number)
{
  int third = int(float(number) * (1.0 / 3.0));
  return third + (((number - 3 * third) * 21846 + 10923) >> 16);
}

MeshCorner mesh_corner()
{
  int triangle = mesh_third(gl_VertexID);
  int row = pc_first_chunk + (triangle >> CHUNK_SHIFT);
  int corner = gl_VertexID - 3 * CHUNK_TRIANGLES * (triangle >> CHUNK_SHIFT);
  ivec4 chunk = ivec4(texelFetch(chunk_tx, ivec2(row & (CHUNK_ROW - 1), int(uint(row) / uint(CHUNK_ROW))), 0));
  MeshCorner found;
  /* Beyond the chunk's last triangle all corners are its last one: no area, and nothing to clip. */
  found.on_page = 3 * chunk.x + min(corner, 3 * chunk.y - 1);
  found.instance = chunk.z + gl_InstanceID;
  found.material = chunk.w;
  vec4 texel = texelFetch(corner_tx, mesh_texel(found.on_page), 0);
  found.position = texel.xyz;
  found.normal = mesh_normal(texel.w);
  return found;
}
