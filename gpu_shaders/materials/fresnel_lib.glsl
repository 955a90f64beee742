/* How much a smooth dielectric reflects: the Fresnel and Layer Weight nodes. */

/* Unpolarised light; `eta`: the IOR beyond the surface by that before it. */
float fresnel_dielectric(float cosine, float eta)
{
  float c = abs(cosine), square = eta * eta - 1.0 + c * c;
  if (square <= 0.0) {
    return 1.0;
  }
  float g = sqrt(square);
  float across = (g - c) / (g + c), along = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
  return 0.5 * across * across * (1.0 + along * along);
}

float fresnel_node(float ior, vec3 normal, vec3 incoming, float backfacing)
{
  float eta = max(ior, 1e-5);
  return fresnel_dielectric(dot(incoming, normal), backfacing > 0.5 ? 1.0 / eta : eta);
}

float fresnel_weight(float blend, vec3 normal, vec3 incoming, float backfacing)
{
  float eta = max(1.0 - blend, 1e-5);
  return fresnel_dielectric(dot(incoming, normal), backfacing > 0.5 ? eta : 1.0 / eta);
}

float fresnel_facing(float blend, vec3 normal, vec3 incoming)
{
  float facing = abs(dot(incoming, normal));
  if (blend != 0.5) {
    blend = clamp(blend, 0.0, 1.0 - 1e-5);
    facing = pow(facing, blend < 0.5 ? 2.0 * blend : 0.5 / (1.0 - blend));
  }
  return 1.0 - facing;
}
