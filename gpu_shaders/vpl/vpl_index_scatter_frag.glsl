void main()
{
  out_point = vec4(float(v_point));
}
