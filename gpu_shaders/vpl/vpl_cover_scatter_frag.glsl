void main()
{
  out_area = v_area;
}
