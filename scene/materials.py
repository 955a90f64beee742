"""Blender material -> Material: colour, specular lobe, emission and images of the common shaders.

The full node graph is to be compiled in place of this file; what it must offer is `MaterialTable`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from .data import Material, Texture
from .images import ImageReader
from .nodes import (
    RGB,
    Socket,
    active_output,
    constant,
    default_rgb,
    find_input,
    mean,
    node_tree,
    source,
)

BLACK: RGB = (0.0, 0.0, 0.0)
MAGENTA: RGB = (1.0, 0.0, 1.0)  # Blender's colour for a missing image
GREY: RGB = (0.8, 0.8, 0.8)

# Shaders shown as a diffuse surface of their colour input for now.
STAND_INS = {
    "ShaderNodeBsdfGlass": "Color",
    "ShaderNodeBsdfRefraction": "Color",
    "ShaderNodeBsdfSheen": "Color",
    "ShaderNodeBsdfVelvet": "Color",
    "ShaderNodeBsdfToon": "Color",
    "ShaderNodeBsdfTranslucent": "Color",
    "ShaderNodeSubsurfaceScattering": "Color",
    "ShaderNodeEeveeSpecular": "Base Color",
}
GLOSSY = {"ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy"}
# What Schlick's Fresnel term adds to a black F0, averaged over all directions of even light.
MEAN_FRESNEL = 1.0 / 21.0
LARGEST_F0 = 0.98  # of a dielectric: IOR 200


@dataclass(frozen=True)
class Paint:
    """A colour, or an image that replaces it."""

    rgb: RGB
    texture: Texture | None = None


@dataclass(frozen=True)
class Surface:
    """What is read of one shader: how it reflects and what it emits. See ``Material``."""

    base: Paint = Paint(BLACK)
    emission: Paint = Paint(BLACK)
    metallic: float = 0.0
    specular: RGB = BLACK
    roughness: float = 0.5
    layered: float = 1.0

    @property
    def without_metal(self) -> Surface:
        """The same with its metal among the specular constants; an image cannot be there and stays as it is."""
        if self.base.texture is not None or self.metallic == 0.0:
            return self
        metal = tuple(self.metallic * c for c in self.base.rgb)
        layer = tuple((1.0 - self.metallic) * c for c in self.specular)
        specular = tuple(a + b for a, b in zip(metal, layer, strict=True))
        share = self.layered * mean(layer) / max(mean(specular), 1e-6)
        base = Paint(tuple((1.0 - self.metallic) * c for c in self.base.rgb))
        return replace(self, base=base, metallic=0.0, specular=specular, layered=share)


@dataclass
class MaterialTable:
    """Indices for materials in the order they are met; index 0 is what a face without a material wears."""

    images: ImageReader
    warn: Callable[[str], None]
    materials: list[Material] = field(default_factory=lambda: [Material("Default")])
    _index: dict[int, int] = field(default_factory=dict)
    _approximated: dict[str, dict[str, None]] = field(default_factory=dict)

    def index(self, material) -> int:
        """The index of a bpy material (None: the default), which is read when it is first met."""
        if material is None:
            return 0
        uid = (material.original or material).session_uid
        if uid not in self._index:
            reader = _Reader(material.name, self)
            self.materials.append(reader.material(material))
            self._index[uid] = len(self.materials) - 1
        return self._index[uid]

    def approximated(self, how: str, name: str) -> None:
        """Count a material among those that share an approximation; ``finish`` names them in one line."""
        self._approximated.setdefault(how, {})[name] = None

    def finish(self) -> tuple[Material, ...]:
        """The table; gives the warnings that are counted over the scene."""
        for how, names in self._approximated.items():
            shown = ", ".join(f"'{name}'" for name in list(names)[:3])
            more = ", …" if len(names) > 3 else ""
            noun = "material" if len(names) == 1 else "materials"
            self.warn(f"{len(names)} {noun} ({shown}{more}): {how}")
        return tuple(self.materials)


class _Reader:
    """Reads one material; at most one warning line for it."""

    def __init__(self, name: str, table: MaterialTable):
        self.name = name
        self.table = table
        self.problems: list[str] = []

    def material(self, material) -> Material:
        tree = node_tree(material)
        if tree is None:
            return Material(self.name, base_color=tuple(material.diffuse_color[:3]))
        output = active_output(tree)
        surface = find_input(output, "Surface") if output else None
        if surface is None or not surface.socket.is_linked:
            return Material(self.name, base_color=BLACK)  # as in Cycles: nothing is reflected
        read = self.surface(surface)
        if _is_driven(find_input(output, "Displacement")):
            self.table.approximated("displacement is not read yet", self.name)
        if self.problems:
            self.table.warn(f"Material '{self.name}': {'; '.join(dict.fromkeys(self.problems))}")
        return Material(
            self.name,
            base_color=read.base.rgb,
            base_color_texture=read.base.texture,
            emission=read.emission.rgb,
            emission_texture=read.emission.texture,
            metallic=read.metallic,
            specular=read.specular,
            roughness=read.roughness,
            layered=read.layered,
        )

    def problem(self, text: str) -> None:
        self.problems.append(text)

    # Shaders

    def surface(self, socket: Socket, depth: int = 0) -> Surface:
        found = source(socket)
        if not found.socket.is_output:
            return Surface()
        kind = found.node.bl_idname
        if _is_driven(found.input("Normal")):
            self.table.approximated("bump and normal maps are not read yet", self.name)
        if depth > 32:
            self.problem("its shader tree is too deep")
            return Surface(Paint(GREY))
        if kind == "ShaderNodeBsdfPrincipled":
            return self.principled(found)
        if kind == "ShaderNodeBsdfDiffuse":
            return Surface(base=self.paint(found.input("Color")))
        if kind in GLOSSY:
            return self.glossy(found)
        if kind == "ShaderNodeBsdfMetallic":
            return self.metal(found)
        if kind == "ShaderNodeEmission":
            return Surface(emission=self.emission(found, "Color", "Strength"))
        if kind == "ShaderNodeMixShader":
            return self.mix(found, depth)
        if kind == "ShaderNodeAddShader":
            a, b = (self.surface(Socket(s, found.groups), depth + 1) for s in found.node.inputs)
            return self.sum(a, 1.0, b, 1.0)
        return self.stand_in(found)

    def principled(self, found: Socket) -> Surface:
        for name, plain, how in (
            ("Transmission Weight", 0.0, "transmission is shown as diffuse for now"),
            ("Alpha", 1.0, "transparency is shown as opaque for now"),
        ):
            socket = found.input(name)
            if socket is None:
                continue
            value = constant(socket)
            if value is None or abs(mean(value) - plain) > 1e-6:  # None: a node makes it
                self.table.approximated(how, self.name)
        emission = self.emission(found, "Emission Color", "Emission Strength")
        return Surface(
            self.paint(found.input("Base Color")),
            emission,
            metallic=self.level(found, "Metallic"),
            specular=self.dielectric(found),
            roughness=self.level(found, "Roughness"),
        )

    def dielectric(self, found: Socket) -> RGB:
        """F0 of a Principled BSDF's dielectric part."""
        ior = max(mean(self.number_of(found, "IOR")), 1e-3)
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2 * 2.0 * max(mean(self.number_of(found, "Specular IOR Level")), 0.0)
        red, green, blue = (min(min(f0, LARGEST_F0) * max(c, 0.0), 1.0) for c in self.number_of(found, "Specular Tint"))
        return red, green, blue

    def glossy(self, found: Socket) -> Surface:
        """A Glossy BSDF, which knows no Fresnel term: a metal that reflects as much on average over all directions."""
        paint = self.paint(found.input("Color"))
        rgb = tuple(max((c - MEAN_FRESNEL) / (1.0 - MEAN_FRESNEL), 0.0) for c in paint.rgb)
        return Surface(replace(paint, rgb=rgb), metallic=1.0, roughness=self.level(found, "Roughness"))

    def metal(self, found: Socket) -> Surface:
        """A Metallic BSDF: its colour, or what its complex IOR reflects at normal incidence."""
        paint = self.paint(found.input("Base Color"))
        if found.node.fresnel_type == "PHYSICAL_CONDUCTOR":
            both = zip(self.number_of(found, "IOR"), self.number_of(found, "Extinction"), strict=True)
            paint = Paint(tuple(((n - 1.0) ** 2 + k * k) / max((n + 1.0) ** 2 + k * k, 1e-6) for n, k in both))
        return Surface(paint, metallic=1.0, roughness=self.level(found, "Roughness"))

    def emission(self, found: Socket, color: str, strength: str) -> Paint:
        factor = mean(self.number(found.input(strength)))
        if factor == 0.0:
            return Paint(BLACK)
        paint = self.paint(found.input(color))
        rgb = (1.0, 1.0, 1.0) if paint.texture else paint.rgb
        return Paint(tuple(c * factor for c in rgb), paint.texture)

    def mix(self, found: Socket, depth: int) -> Surface:
        factor, first, second = (Socket(s, found.groups) for s in found.node.inputs[:3])
        value = constant(factor)
        weight = 0.5 if value is None else min(max(mean(value), 0.0), 1.0)
        if value is None:
            self.problem(f"node '{source(factor).node.name}' as a mix factor is not read yet, both shaders count half")
        a = self.surface(first, depth + 1) if weight < 1.0 else Surface()
        b = self.surface(second, depth + 1) if weight > 0.0 else Surface()
        return self.sum(a, 1.0 - weight, b, weight)

    def sum(self, a: Surface, wa: float, b: Surface, wb: float) -> Surface:
        a, b = a.without_metal, b.without_metal
        base = self.sum_paint(a.base, wa, b.base, wb, multiplies=False)
        shares = [w * mean(s.specular) for w, s in ((wa, a), (wb, b))]
        whole = sum(shares)
        shown = a if base.texture is a.base.texture else b
        lobe = a if shares[0] >= shares[1] else b
        return Surface(
            replace(base, rgb=tuple(min(c, 1.0) for c in base.rgb)),
            self.sum_paint(a.emission, wa, b.emission, wb, multiplies=True),
            metallic=shown.metallic,
            specular=tuple(min(wa * x + wb * y, 1.0) for x, y in zip(a.specular, b.specular, strict=True)),
            roughness=(shares[0] * a.roughness + shares[1] * b.roughness) / whole if whole else lobe.roughness,
            layered=(shares[0] * a.layered + shares[1] * b.layered) / whole if whole else 1.0,
        )

    def sum_paint(self, a: Paint, wa: float, b: Paint, wb: float, multiplies: bool) -> Paint:
        """A weighted sum. Only one image survives, the heavier shader's; one that ``multiplies`` keeps its weight."""
        if a.texture is None and b.texture is None:
            return Paint(tuple(wa * x + wb * y for x, y in zip(a.rgb, b.rgb, strict=True)))
        first_wins = (a.texture is not None, wa) >= (b.texture is not None, wb)
        shown, weight, lost, lost_weight = (a, wa, b, wb) if first_wins else (b, wb, a, wa)
        if lost_weight > 0.0 and (lost.texture or any(lost.rgb)) or (weight != 1.0 and not multiplies):
            self.problem("of mixed shaders only one image is shown")
        return Paint(tuple(c * weight for c in shown.rgb) if multiplies else shown.rgb, shown.texture)

    def stand_in(self, found: Socket) -> Surface:
        node = found.node
        name = STAND_INS.get(node.bl_idname)
        color = found.input(name) if name else None
        if color is not None:
            self.problem(f"node '{node.name}' is shown as diffuse for now")
            return Surface(base=self.paint(color))
        if node.bl_idname in {"ShaderNodeBsdfTransparent", "ShaderNodeHoldout"}:
            self.problem(f"node '{node.name}' is not shown yet, it reflects nothing")
            return Surface()
        self.problem(f"node '{node.name}' is not read yet, grey is shown")
        return Surface(Paint(GREY))

    # Colours and numbers

    def number_of(self, found: Socket, name: str) -> RGB:
        """A constant of a shader's lobe; whatever a node makes of it is one number for now."""
        socket = found.input(name)
        value = socket and constant(socket)
        if socket is None or value is not None:
            return value or BLACK
        self.table.approximated(f"{name.lower()} is one number all over for now", self.name)
        made = source(socket)
        if made.node.bl_idname == "ShaderNodeTexImage" and made.node.image and made.socket.identifier != "Alpha":
            key = self.table.images.read(made.node.image, made.node.image_user)
            if key is not None:
                red, green, blue = self.table.images.images[key].pixels[..., :3].mean((0, 1), dtype="f8").tolist()
                return red, green, blue
        return default_rgb(socket.socket)

    def level(self, found: Socket, name: str) -> float:
        """The same for a number from 0 to 1."""
        return min(max(mean(self.number_of(found, name)), 0.0), 1.0)

    def number(self, socket: Socket | None) -> RGB:
        if socket is None:
            return BLACK
        value = constant(socket)
        if value is None:
            self.unread(source(socket))
            return default_rgb(socket.socket)
        return value

    def paint(self, socket: Socket | None) -> Paint:
        if socket is None:
            return Paint(GREY)
        found = source(socket)
        if found.socket.is_output and found.node.bl_idname == "ShaderNodeTexImage" and not found.node.mute:
            return self.image(found, socket)
        return Paint(self.number(socket))

    def unread(self, found: Socket) -> None:
        self.problem(f"node '{found.node.name}' is not read yet, the socket's own value is shown")

    def image(self, found: Socket, socket: Socket) -> Paint:
        node = found.node
        if found.socket.identifier == "Alpha":
            self.unread(found)
            return Paint(default_rgb(socket.socket))
        if node.image is None:
            return Paint(BLACK)  # as in Cycles: an Image Texture node without an image is black
        key = self.table.images.read(node.image, node.image_user)
        if key is None:
            return Paint(MAGENTA)
        if node.projection != "FLAT":
            self.problem(f"node '{node.name}' is projected by UV instead of {node.projection.lower()}")
        if node.extension in {"CLIP", "MIRROR"}:
            self.problem(f"node '{node.name}' extends its edge instead of {node.extension.lower()}")
        texture = Texture(
            key,
            uv_map=self.uv_map(found.input("Vector")),
            repeat=node.extension == "REPEAT",
            closest=node.interpolation == "Closest",
        )
        return Paint(GREY, texture)

    def uv_map(self, vector: Socket | None) -> str:
        """The UV map behind an image's vector input; "" for the active one."""
        found = vector and source(vector)
        if not found or not found.socket.is_output:
            return ""
        if found.node.bl_idname == "ShaderNodeUVMap":
            return found.node.uv_map
        if found.node.bl_idname == "ShaderNodeTexCoord" and found.socket.identifier == "UV":
            return ""
        if found.node.bl_idname == "ShaderNodeMapping":
            self.problem(f"node '{found.node.name}' is not read yet, the image is not moved or scaled")
            return self.uv_map(found.input("Vector"))
        self.problem(f"node '{found.node.name}' is not read yet, the image is laid by the active UV map")
        return ""


def _is_driven(socket: Socket | None) -> bool:
    """Whether a node that is not muted makes the value of an input."""
    found = socket and source(socket)
    return bool(found and found.socket.is_output and not found.node.mute)
