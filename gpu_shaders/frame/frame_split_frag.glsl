/* Left of a line the picture without bounced light, right of it the whole one. */
void main()
{
  out_color = uv.x < pc_place ? texture(without_tx, uv) * pc_weight : texture(image_tx, uv);
}
