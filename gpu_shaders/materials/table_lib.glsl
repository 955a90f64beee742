/* Color Ramp and curves: tables of TABLE_SIZE rows in the materials' values, as Cycles samples them. `value_fetch` is
 * the generated shader's, one texel of its material's row. */

/* Row `index` of the table that begins at texel `start`. */
vec4 table_row(int start, float place, bool smooth_between)
{
  float at = clamp(place, 0.0, 1.0) * float(TABLE_SIZE - 1);
  int row = int(at);
  vec4 value = value_fetch(start + row);
  if (!smooth_between || float(row) == at) {
    return value;
  }
  return mix(value, value_fetch(start + row + 1), at - float(row));
}

/* A curve's value, continued as a straight line beyond its ends where `extended`. */
vec4 table_curve(int start, float place, bool extended)
{
  vec4 value = table_row(start, place, true);
  if (extended && place < 0.0) {
    value += (value_fetch(start) - value_fetch(start + 1)) * -place * float(TABLE_SIZE - 1);
  }
  if (extended && place > 1.0) {
    value += (value_fetch(start + TABLE_SIZE - 1) - value_fetch(start + TABLE_SIZE - 2)) * (place - 1.0) *
             float(TABLE_SIZE - 1);
  }
  return value;
}

/* Three curves of three numbers; `low` and `high`: the range of the points' places. */
vec3 table_curves(int start, vec3 place, float low, float high, bool extended)
{
  vec3 at = (place - low) / (high - low);
  return vec3(table_curve(start, at.x, extended).x, table_curve(start, at.y, extended).y,
              table_curve(start, at.z, extended).z);
}
