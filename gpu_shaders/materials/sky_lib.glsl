/* A Sky Texture: a picture of the sky around (scene/sky.py), and the sun's disc before it. */

struct SkySun {
  float turn; /* angle of the sun around Z from X, radians, as all of these */
  float elevation;
  float radius; /* of the disc; 0: there is none */
  float earth;  /* elevation at which the ground begins */
  vec3 bottom;  /* radiance of its lowest and highest point */
  vec3 top;
};

const float SKY_PI = 3.14159265358979;
/* The limb of the sun is darker than its middle: by so much, and what is left on average. */
const float SKY_LIMB = 0.6;
const float SKY_MEAN_LIMB = 0.8;

vec3 sky_disc(SkySun sun, vec3 d, float elevation, float footprint)
{
  vec3 axis = vec3(cos(sun.elevation) * vec2(cos(sun.turn), sin(sun.turn)), sin(sun.elevation));
  float off = 2.0 * asin(min(0.5 * distance(d, axis), 1.0));
  vec3 radiance = mix(sun.bottom, sun.top, (elevation - sun.elevation) / (2.0 * sun.radius) + 0.5);
  if (footprint == 0.0) {
    float part = min(off / sun.radius, 1.0);
    return off < sun.radius ? radiance * (1.0 - SKY_LIMB * (1.0 - sqrt(1.0 - part * part))) : vec3(0.0);
  }
  /* A disc too small for the samples is made wider; its rim is smooth, and its light stays the same. */
  float radius = max(sun.radius, footprint);
  float covered = clamp((radius - off) / footprint + 0.5, 0.0, 1.0);
  float gain = sun.radius * sun.radius / (radius * radius + footprint * footprint / 12.0);
  return 0.5 * (sun.bottom + sun.top) * (SKY_MEAN_LIMB * gain * covered);
}

vec3 sky_radiance(sampler2D sky_tx, SkySun sun, vec3 direction, float footprint)
{
  vec3 d = direction / max(length(direction), 1e-20);
  float elevation = asin(clamp(d.z, -1.0, 1.0));
  float turn = d.x == 0.0 && d.y == 0.0 ? 0.0 : atan(d.y, d.x);
  float up = sqrt(abs(elevation) / (0.5 * SKY_PI));
  vec2 place = vec2(fract((turn - sun.turn) / (2.0 * SKY_PI) + 0.5), 0.5 + 0.5 * (elevation < 0.0 ? -up : up));
  /* Around it the picture repeats; above and below, it ends. */
  place.y = clamp(place.y, 0.5 / float(textureSize(sky_tx, 0).y), 1.0 - 0.5 / float(textureSize(sky_tx, 0).y));
  vec3 sky = texture_sample(sky_tx, place, 0, 0, 0, false).rgb;
  if (sun.radius > 0.0 && elevation > sun.earth) {
    sky += sky_disc(sun, d, elevation, footprint);
  }
  return sky;
}
