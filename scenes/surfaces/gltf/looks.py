"""Looks: the albedo of a part of a glTF file, and its texture coordinates.

    albedo = luminance of (base colour x picture x COLOR_0)          glTF 2.0, 3.9.2
    (u, v) of the picture = offset + R(rotation) (scale x (u, v))    KHR_texture_transform

Pictures are sRGB, factors and COLOR_0 linear.  Alpha counts where it hides a whole part; the rest is opaque.
"""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from scenes.film.transfer import grey, linear_from_srgb
from scenes.surfaces.assembly import Albedo
from scenes.surfaces.gltf.container import File, Tree
from scenes.surfaces.gltf.nodes import extension
from scenes.surfaces.gltf.shapes import Shape, Table
from scenes.surfaces.materials import UNSTATED_ALBEDO, colour_of, pixels_of
from scenes.surfaces.unshown import ALPHA_MASK, NO_COORDINATES, TRANSPARENCY
from scenes.surfaces.wrapping import CLAMP, KEEP, MIRROR, unrolled
from spikecam_env.errors import InputError
from spikecam_env.types import Pictures

WRAPS = {10497: KEEP, 33071: CLAMP, 33648: MIRROR}
"""Of a sampler, by OpenGL's numbers; renderers repeat along an axis that is KEEP."""
NEAREST = 9728
GLOSS = "KHR_materials_pbrSpecularGlossiness"
TRANSFORM, STRENGTH = "KHR_texture_transform", "KHR_materials_emissive_strength"
SOURCES = ("EXT_texture_webp",)
"""Extensions that name another picture, which Pillow reads."""


@dataclass(frozen=True, eq=False)
class Look:
    """Of a part."""

    albedo: Albedo
    """One value, one for each vertex (V,), or a texture (h, w)."""
    uv: Table | None
    """(V, 2), v = 1 at the top of the texture; None where the part has no coordinates."""
    emission: float = 0.0
    """Radiance that it gives by itself."""


class Looks:
    """The looks of a file's parts; a picture is decoded once.

    Args:
        file: the file that holds them.
        own: whether the file's own albedo is wanted; else parts have one value, and coordinates for another texture.
    """

    def __init__(self, file: File, own: bool) -> None:
        self._file, self._own = file, own
        self._pixels: dict[int, tuple[Pictures, Pictures] | None] = {}
        self._textures: dict[tuple[int, bytes], Pictures] = {}

    def of(self, whole: Shape, primitive: Tree) -> Look | None:
        """The look of a primitive; None where alpha hides it.

        Raises:
            InputError: a colour is out of 0 to full scale, or coordinates are not finite.
        """
        material = self._material(primitive)
        base, info = _base(material)
        uv = self._coordinates(whole, info)
        number = None if info is None or uv is None else self._source(info)
        colours = _checked(whole.tables.get("COLOR_0"))
        alphas = [np.array([1.0] if base is None else base[3:4] or [1.0])]
        alphas += [] if number is None else [self._decoded(number)[1].astype(np.float64)]
        alphas += [] if colours is None else [colours[:, 3]]
        if self._hidden(material, alphas):
            return None
        emission = self._emission(material)
        if not self._own:
            return Look(UNSTATED_ALBEDO, uv, emission)
        factor = None if base is None else colour_of(base[:3])
        if info is None or uv is None or number is None:
            return Look(_plain(factor, colours), uv, emission)
        texture, colours = self._shaded(number, factor, colours)
        if colours is not None:
            return Look(_plain(texture, colours), uv, emission)
        return Look(*unrolled(texture, uv, *self._wraps(info)), emission)

    def _shaded(self, number: int, factor: Pictures | None, colours: Table | None) -> tuple[Pictures, Table | None]:
        """A picture times all colours, (h, w).

        Where it has one colour and the vertices several: that colour (3,), and those of the vertices.
        """
        shade = np.ones(3, np.float32) if factor is None else factor
        if colours is not None and np.ptp(colours[:, :3], axis=0).any():
            rgb = self._decoded(number)[0]
            if not np.ptp(rgb, axis=(0, 1)).any():
                return shade * linear_from_srgb(rgb[0, 0]), colours
            self._file.without("colours of vertices beside a texture")
        elif colours is not None:
            shade = shade * np.float32(colours[0, :3])
        return self._texture(number, shade), None

    def is_two_sided(self, primitive: Tree) -> bool:
        """Whether the backs of a primitive reflect like its fronts."""
        return bool(self._material(primitive).get("doubleSided", False))

    def _material(self, primitive: Tree) -> Tree:
        return self._file.item("materials", primitive["material"]) if "material" in primitive else {}

    def _coordinates(self, whole: Shape, info: Tree | None) -> Table | None:
        """(V, 2) of the picture, v upwards; without a picture those of the first set."""
        transform = extension(info or {}, TRANSFORM)
        number = transform.get("texCoord", (info or {}).get("texCoord", 0))
        uv = whole.tables.get(f"TEXCOORD_{number}")
        if uv is None:
            if info is not None:
                self._file.without(NO_COORDINATES)
            return None
        turn = transform.get("rotation", 0.0)
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        at = uv[:, :2] * np.array(transform.get("scale", (1, 1))) @ rotation.T + np.array(
            transform.get("offset", (0, 0))
        )
        return np.stack([at[:, 0], 1 - at[:, 1]], -1)

    def _source(self, info: Tree) -> int | None:
        """The number of a texture's image, where it can be decoded."""
        texture = self._file.item("textures", info["index"])
        number = texture.get("source")
        for name in SOURCES:
            number = extension(texture, name).get("source", number)
        if number is None:
            self._file.without("a texture whose picture is in no known format")
            return None
        return None if self._opened(number) is None else int(number)

    def _opened(self, number: int) -> tuple[Pictures, Pictures] | None:
        """Colours (h, w, 3) and alpha (h, w) of an image; None, with a note, where it is missing or damaged."""
        if number not in self._pixels:
            self._pixels[number] = None
            if (data := self._bytes(number)) is not None:
                try:
                    with Image.open(BytesIO(data)) as picture:
                        self._pixels[number] = pixels_of(picture)
                except InputError:
                    raise
                except Exception:  # the many ways in which a damaged picture fails
                    self._file.without(f"image {number} (damaged, or in no known format)")
        return self._pixels[number]

    def _bytes(self, number: int) -> bytes | None:
        """Of an image; None where it cannot be had, which `beside` notes of other files."""
        image = self._file.item("images", number)
        if "bufferView" in image:
            return self._file.view(image["bufferView"])
        try:
            return self._file.at(image["uri"])
        except (OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            if image["uri"].startswith("data:"):
                self._file.without(f"image {number} (damaged, or in no known format)")
            return None

    def _decoded(self, number: int) -> tuple[Pictures, Pictures]:
        pixels = self._opened(number)
        if pixels is None:
            raise RuntimeError("only images that could be decoded have a number here")
        return pixels

    def _texture(self, number: int, shade: Pictures) -> Pictures:
        """(h, w) albedo of an image times a colour; the same array for the same two."""
        key = (number, np.float32(shade).tobytes())
        if key not in self._textures:
            self._textures[key] = grey(linear_from_srgb(self._decoded(number)[0]) * shade)
        return self._textures[key]

    def _wraps(self, info: Tree) -> tuple[str, str]:
        texture = self._file.item("textures", info["index"])
        sampler = self._file.item("samplers", texture["sampler"]) if "sampler" in texture else {}
        if sampler.get("magFilter") == NEAREST:
            self._file.without("sharp texels (NEAREST)")
        return WRAPS[sampler.get("wrapS", 10497)], WRAPS[sampler.get("wrapT", 10497)]

    def _hidden(self, material: Tree, alphas: list[Any]) -> bool:
        """Whether alpha hides all of a part; notes where it hides some of it."""
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "OPAQUE":
            return False
        least, most = (float(np.prod([side(alpha) for alpha in alphas])) for side in (np.min, np.max))
        if mode == "MASK":
            cutoff = material.get("alphaCutoff", 0.5)
            hidden, name, some = most < cutoff, ALPHA_MASK, least < cutoff
        else:
            hidden, name, some = most <= 0, TRANSPARENCY, least < 1
        if some and not hidden:
            self._file.without(name)
        return bool(hidden)

    def _emission(self, material: Tree) -> float:
        """Of a material that emits one colour; notes where a picture says how much."""
        factor = np.array(material.get("emissiveFactor", (0, 0, 0)), np.float32)
        if not factor.any():
            return 0.0
        if "emissiveTexture" in material:
            self._file.without("an emissive texture")
            return 0.0
        strength = float(extension(material, STRENGTH).get("emissiveStrength", 1.0))
        light = float(grey(factor[None, None])[0, 0]) * strength
        if not 0 <= light < np.inf:
            raise InputError(f"a material emits {light:g}; it must be 0 or more, and finite")
        return light


def _base(material: Tree) -> tuple[list[float] | None, Tree | None]:
    """The factor (red, green, blue, alpha) that a material states, and its picture's entry."""
    gloss = extension(material, GLOSS)
    if gloss:
        return gloss.get("diffuseFactor"), gloss.get("diffuseTexture")
    rough = material.get("pbrMetallicRoughness", {})
    return rough.get("baseColorFactor"), rough.get("baseColorTexture")


def _checked(colours: Table | None) -> Table | None:
    """(V, 4) linear, alpha 1 where there is none."""
    if colours is None or not len(colours):
        return None
    low, high = colours.min(), colours.max()
    if not (low >= 0 and high <= 1):
        raise InputError(f"colours run from {low:g} to {high:g}; they must lie in 0 to full scale")
    return np.concatenate([colours, np.ones((len(colours), 4 - colours.shape[1]))], 1)


def _plain(factor: Pictures | None, colours: Table | None) -> Albedo:
    """Of a part without a picture."""
    if factor is None and colours is None:
        return UNSTATED_ALBEDO
    shade = np.ones(3, np.float32) if factor is None else factor
    if colours is None:
        return float(grey(shade[None, None])[0, 0])
    return np.asarray(grey((np.float32(colours[:, :3]) * shade)[None])[0].clip(0, 1))
