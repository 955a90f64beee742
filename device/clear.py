"""The shader that clears a part of a target."""

from .shader import Shader


def clear_shader(scalars: tuple[str, ...], has_depth: bool) -> Shader:
    """A shader that fills a viewport: no version's own clear can be trusted to respect a tile."""
    types = {"FLOAT": "VEC4", "INT": "INT", "UINT": "UINT"}
    values = {"FLOAT": "{}", "INT": "int({}.x)", "UINT": "uint({}.x)"}
    lines = [f"  out_{slot} = {values[s].format(f'pc_color_{slot}')};" for slot, s in enumerate(scalars)]
    lines += ["  gl_FragDepth = pc_depth;"] if has_depth else []
    constants = {f"pc_color_{slot}": "VEC4" for slot in range(len(scalars))} | (
        {"pc_depth": "FLOAT"} if has_depth else {}
    )
    text = "void main()\n{\n" + "\n".join(lines) + "\n}\n"
    return Shader(
        "_".join(("device_clear", *(s.lower() for s in scalars), *(["depth"] if has_depth else []))),
        fragment="device/clear_frag.glsl",
        files={"device/clear_frag.glsl": text},
        outputs={f"out_{slot}": types[s] for slot, s in enumerate(scalars)},
        constants=constants,
        depth_write=has_depth,
    )
