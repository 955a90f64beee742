"""Complete GLSL 4.30 core texts from a Shader: for moderngl, and for checking with glslangValidator."""

from typing import TYPE_CHECKING

from .source import Source

if TYPE_CHECKING:
    from .shader import Shader

# One triangle that covers the view; uv is [0, 1] over it. Its depth is 0.5.
FULLSCREEN_VERTEX = """\
void main()
{
  uv = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  gl_Position = vec4(uv * 2.0 - 1.0, 0.0, 1.0);
}
"""

# The same names that Blender gives, so that a source may ask which stage it is in.
_STAGE_DEFINES = {"vertex": "GPU_VERTEX_SHADER", "fragment": "GPU_FRAGMENT_SHADER", "compute": "GPU_COMPUTE_SHADER"}
_PREFIX = {"FLOAT": "", "INT": "i", "UINT": "u"}


def glsl_type(name: str) -> str:
    """ "VEC3" to "vec3"."""
    return name.lower()


def sampler_type(name: str) -> str:
    """ "UINT_3D" to "usampler3D"."""
    return _texture_type(name, "sampler")


def image_type(name: str) -> str:
    """ "UINT_3D_ATOMIC" to "uimage3D"."""
    return _texture_type(name.removesuffix("_ATOMIC"), "image")


def _texture_type(name: str, kind: str) -> str:
    scalar, dimension = name.split("_", 1)
    return _PREFIX[scalar] + kind + dimension


def complete(shader: "Shader", stage: str) -> Source:
    """One stage with everything it needs, ready for a GLSL 4.30 compiler. Raises ShaderError."""
    body = shader.assemble(stage)
    source = Source()
    source.add("\n".join(_declarations(shader, stage)), f"<declarations of {shader.name}>")
    source.extend(body)
    return source


def _declarations(shader: "Shader", stage: str) -> list[str]:
    lines = ["#version 430 core", f"#define {_STAGE_DEFINES[stage]}", "#define SHARED shared"]
    lines += [f"#define {name} {value}" for name, value in shader.defines]
    lines += [struct.glsl_struct() for struct in shader.all_structs]
    lines += _stage_declarations(shader, stage)
    for slot, (name, type_name) in enumerate(shader.samplers.items()):
        lines.append(f"layout(binding = {slot}) uniform {sampler_type(type_name)} {name};")
    for slot, (name, image) in enumerate(shader.images.items()):
        access = {"READ": "readonly ", "WRITE": "writeonly ", "READ_WRITE": ""}[image.access]
        layout = f"binding = {slot}, {image.format.lower()}"
        lines.append(f"layout({layout}) restrict {access}uniform {image_type(image.type)} {name};")
    for slot, (name, struct) in enumerate(shader.uniforms.items()):
        # Blender makes a macro of the name as well: a parameter or local of that name must fail here, too.
        lines.append(f"layout(std140, binding = {slot}) uniform {name}_block {{ {struct.name} {name}_data; }};")
        lines.append(f"#define {name} ({name}_data)")
    lines += [f"uniform {glsl_type(type_name)} {name};" for name, type_name in shader.constants.items()]
    return lines


def _stage_declarations(shader: "Shader", stage: str) -> list[str]:
    varyings = shader.all_varyings.items()
    if stage == "compute":
        x, y, z = shader.local_size
        return [f"layout(local_size_x = {x}, local_size_y = {y}, local_size_z = {z}) in;"]
    if stage == "vertex":
        attributes = enumerate(shader.inputs.items())
        return [f"layout(location = {slot}) in {glsl_type(t)} {name};" for slot, (name, t) in attributes] + [
            f"{how} out {glsl_type(t)} {name};" for name, (how, t) in varyings
        ]
    outputs = enumerate(shader.outputs.items())
    return [f"{how} in {glsl_type(t)} {name};" for name, (how, t) in varyings] + [
        f"layout(location = {slot}) out {glsl_type(t)} {name};" for slot, (name, t) in outputs
    ]
