/* What a material wants of a mesh's corners: nothing where it is the same all over. Generated for node graphs. */
void material_corner(int on_page)
{
}
