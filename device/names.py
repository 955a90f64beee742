"""What may be a name in GLSL, in every supported Blender version and on every backend."""

import re

# Words some Blender version or backend refuses as an identifier.
RESERVED = frozenset(
    re.findall(
        r"\w+",
        "input output half common partition active filter buffer shared sample flat template this class union enum "
        "typedef namespace using goto inline static long short public external interface fixed unsigned superp char "
        "resource sampler2D sampler3D packed constant device thread threadgroup sampler texture2D main float int "
        "uint bool vec2 vec3 vec4 mat3 mat4 in out inout void const return if else for while do break continue "
        "discard switch case struct uniform attribute varying layout texture texelFetch ",
    )
)


def is_name(name: str) -> bool:
    """Whether every supported compiler takes it for an identifier."""
    plain = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) and "__" not in name and not name.startswith("gl_")
    return bool(plain) and name not in RESERVED
