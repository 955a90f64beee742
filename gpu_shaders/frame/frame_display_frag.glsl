void main()
{
  out_color = texture(image_tx, uv);
}
