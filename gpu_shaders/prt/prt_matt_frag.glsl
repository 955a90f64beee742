/* Irradiance / pi between the vertices. The position's w says that the light of the sky is here already. */
void main()
{
  out_position = vec4(v_position, 1.0 + float(prt_draw.has));
  out_diffuse = vec4(max(v_light, vec3(0.0)), 1.0);
  out_glossy = vec4(0.0);
}
