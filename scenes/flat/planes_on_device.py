"""Scenes on a plane painted on a torch device: textures are uploaded once, and a few numbers a key go there.

The law is that of `painted_disk.py`: a bilinear tile, discs over it by the share of a pixel inside the rim.  Light
differs from the processor's by the rounding of float32.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import grid_sample

from scenes.flat.painted_disk import PlacedDisc, Plane, Texels, places_of
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.engines.gpu import checked_device
from spikecam_env.types import Floats, Pictures

TOGETHER = 1 << 25
"""Pixels that are painted at a time: 1 GB of intermediate results."""

KEPT = 512
"""Textures and tiles that are kept on devices: those of all tasks."""

OF_TILE, OF_DISC = 4, 6
"""Numbers a key: of the tile column, row, and shares of the next ones; of each disc as `places_of` has them."""


def planes_on(planes: Sequence[Plane], device: str | torch.device) -> list[Keyframes]:
    """As `scenes.flat.planes.painted_planes`, radiance being a tensor on the device.

    Planes that show the same textures are painted in one go, since a key is a picture of its own.

    Raises:
        InputError: the device is missing.
    """
    checked = checked_device(device, "leave device out")
    groups: dict[Any, list[int]] = {}
    for number, plane in enumerate(planes):
        groups.setdefault(_look(plane), []).append(number)
    light: dict[int, Any] = {}
    for numbers in groups.values():
        alike = [planes[number] for number in numbers]
        pictures = PlanePainter(alike[0], checked).painted(alike)
        light |= zip(numbers, pictures.split([len(plane.frame) for plane in alike]), strict=True)
    return [Keyframes.known(plane.frame, light[number]) for number, plane in enumerate(planes)]


class PlanePainter:
    """Paints planes with the tile and the discs' textures of `plane`, wherever these lie, on a device."""

    def __init__(self, plane: Plane, device: torch.device) -> None:
        self._shape, self._device = plane.shape, device
        self._tile = uploaded(plane.tile.samples, device, lambda _: plane.tile.in_order())
        self._step = plane.tile.step
        self._discs = [(disc, *(_bits(texels, device) for texels in (disc.texels, disc.mask))) for disc in plane.discs]

    def painted(self, planes: Sequence[Plane]) -> Tensor:
        """(K, H, W) float32, the keys of one plane after those of another."""
        numbers = self.numbers(planes)
        still = bool((numbers[:, :OF_TILE] == numbers[:1, :OF_TILE]).all())
        on_device = torch.from_numpy(numbers).to(self._device)
        many = max(1, TOGETHER // (self._shape[0] * self._shape[1]))
        return torch.cat([self.paint(some, still) for some in on_device.split(many)])

    def numbers(self, planes: Sequence[Plane]) -> Pictures:
        """(K, OF_TILE + OF_DISC for each disc) numbers of each key."""
        pan, tilt = (np.concatenate([getattr(plane, name) for plane in planes]) for name in ("pan", "tilt"))
        of_keys = [_tile_numbers(pan, tilt, self._tile.shape)]
        for d, (disc, *_) in enumerate(self._discs):
            of_disc = ([getattr(plane.discs[d], name) for plane in planes] for name in ("x", "y", "angle"))
            x, y, angle = map(np.concatenate, of_disc)
            of_keys.append(places_of(np.tile(disc.grid, (len(x), 1)), x, y, angle))
        return np.concatenate(of_keys, axis=1).astype(np.float32)

    def paint(self, numbers: Tensor, still: bool = False) -> Tensor:
        """(K, H, W) light, from `numbers` on the device; with `still` the tile lies in each key as in the first."""
        picture = _tile_on(self._tile, numbers[:1] if still else numbers, self._shape, self._step)
        for d, (disc, bits, mask) in enumerate(self._discs):
            first = OF_TILE + d * OF_DISC
            picture = _over(picture, disc, bits, mask, numbers[:, first : first + OF_DISC])
        return picture.expand(len(numbers), *self._shape)


def _tile_numbers(x: Floats, y: Floats, shape: Sequence[int]) -> Floats:
    """(K, OF_TILE) of a tile of `shape`, seen from places x, y (K,) [samples]."""
    left, top = np.floor(x), np.floor(y)
    return np.stack([left % shape[1], top % shape[0], x - left, y - top], axis=1)


def _tile_on(tile: Tensor, numbers: Tensor, shape: tuple[int, int], step: int) -> Tensor:
    """(K, H, W): a repeated tile, bilinear, from numbers (K, OF_TILE) or more, with `step` samples a pixel."""
    left, top, right_share, lower_share = (numbers[:, i, None, None] for i in range(OF_TILE))
    row = top.long() + step * torch.arange(shape[0], device=tile.device)[None, :, None]
    column = left.long() + step * torch.arange(shape[1], device=tile.device)[None, None, :]
    upper, lower = row % tile.shape[0], (row + 1) % tile.shape[0]
    here, right = column % tile.shape[1], (column + 1) % tile.shape[1]
    to_left = torch.lerp(tile[upper, here], tile[lower, here], lower_share)
    to_right = torch.lerp(tile[upper, right], tile[lower, right], lower_share)
    return torch.lerp(to_left, to_right, right_share)


def _over(behind: Tensor, disc: PlacedDisc, bits: Tensor, mask: Tensor | None, places: Tensor) -> Tensor:
    """A disc or shape over the picture behind it (K or 1, H, W), at places (K, OF_DISC)."""
    x, y, u0, v0, cosine, sine = (places[:, i, None, None] for i in range(OF_DISC))
    row = torch.arange(behind.shape[1], device=bits.device, dtype=torch.float32)[None, :, None]
    column = torch.arange(behind.shape[2], device=bits.device, dtype=torch.float32)[None, None, :]
    where = torch.stack([u0 + cosine * column - sine * row, v0 + sine * column + cosine * row], dim=-1)
    if disc.texels.period:
        where = where.remainder(disc.texels.period)
    light = _seen(disc.texels, bits, where)
    if disc.mask is not None and mask is not None:
        return light + (1.0 - _seen(disc.mask, mask, where)) * behind
    cover = (disc.radius + 0.5 - torch.hypot(column - x, row - y)).clamp(0.0, 1.0)
    return torch.lerp(behind, light, cover)


def _seen(texels: Texels, bits: Tensor, where: Tensor) -> Tensor:
    """(K, H, W): a square picture, bilinear, at places (K, H, W, 2) [texels]."""
    to_grid = 2.0 / (texels.side - 1)  # places of texels as -1 .. 1
    every = bits.expand(len(where), 1, -1, -1)
    steps = grid_sample(every, where * to_grid - 1.0, padding_mode="border", align_corners=True)[:, 0]
    return float(texels.low) + float(texels.step) * steps


def _look(plane: Plane) -> tuple[Any, ...]:
    """Features common to planes that are painted in one go."""
    discs = (
        (id(disc.texels.pairs), float(disc.texels.low), float(disc.texels.step), disc.radius, id(disc.mask))
        for disc in plane.discs
    )
    return plane.shape, id(plane.tile.samples), *discs


def _bits(texels: Texels | None, device: torch.device) -> Any:
    """(side, side) float32, in steps of the texels; None of none."""
    if texels is None:
        return None
    side = texels.side
    return uploaded(texels.pairs, device, lambda pairs: (pairs & 0xFFFF).astype(np.float32).reshape(side, side))


def uploaded(
    array: NDArray[Any], device: torch.device, made: Callable[[NDArray[Any]], Pictures] = np.asarray
) -> Tensor:
    """A tensor on a device, made of an array that is never written to; the last KEPT are kept there."""
    key = id(array), str(device)
    if key not in _UPLOADED:
        _UPLOADED[key] = array, torch.from_numpy(np.ascontiguousarray(made(array))).to(device)
        if len(_UPLOADED) > KEPT:
            _UPLOADED.popitem(last=False)
    _UPLOADED.move_to_end(key)
    return _UPLOADED[key][1]


_UPLOADED: OrderedDict[tuple[int, str], tuple[NDArray[Any], Tensor]] = OrderedDict()
"""With the array, so that no other gets its id."""
