void main()
{
  out_point = v_point;
}
