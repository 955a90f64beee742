#include "frame/shadow_slope_lib.glsl"

void main()
{
  shadow_write();
}
