"""Planar scenes painted on a torch device give the processor's light; on a processor, and on a GPU if any."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from scenes.flat.collage import Collage
from scenes.flat.discs import Disc, Discs, PiecewisePath
from scenes.flat.disk import RotatingDisk
from scenes.flat.painted_disk import Texels, prefiltered
from scenes.flat.planes import painted_planes
from scenes.flat.planes_on_device import planes_on
from scenes.flat.sliding import SlidingTexture
from scenes.protocol import Gaze
from spikecam_env.errors import InputError

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
SHAPE = (53, 64)
MOST_APART = 1e-5
"""Of full scale, rms, by rounding alone; ten times as much at a pixel."""
TURNED = Gaze((-7.25, 3.5), (12.0, -9.75), (3.0, 40.0))


def discs() -> Discs:
    """Two that overlap, one at the picture's corner."""
    rng = np.random.default_rng(0)
    texels = [Texels.of(prefiltered(rng.random((64, 64)), radius)) for radius in (9.0, 14.5)]
    path = PiecewisePath.straight((-20.0, -2.0), (0.4, 0.3), 100.0)
    return Discs(
        SHAPE,
        40_000.0,
        rng.random((31, 37)).astype(np.float32),
        {
            "small": Disc(texels[0], 9.0, path, rpm=900.0),
            "large": Disc(texels[1], 14.5, PiecewisePath.still(20.0, 20.0), rpm=-300.0, angle=1.0),
            "corner": Disc(texels[0], 9.0, PiecewisePath.still(62.0, 50.0)),
        },
    )


SCENES = {
    "disk": lambda: RotatingDisk(SHAPE),
    "drifting": lambda: RotatingDisk(SHAPE, rpm=-8000.0, centre=(3.2, 50.1), drift_px_s=(9000.0, -4000.0)),
    "flat background": lambda: RotatingDisk(SHAPE, background=0.1).lit(0.1),
    "discs": discs,
    "collage": lambda: Collage(SHAPE, 3, speed=2.0),
    "sliding": lambda: SlidingTexture(SHAPE, (23_000.0, -7_000.0)),
    "sliding, coarse": lambda: SlidingTexture(SHAPE, (-9_000.0, 100.0), np.eye(5), texel_px=3.1).lit(0.5),
}


@pytest.mark.parametrize("gaze", [None, TURNED], ids=["at rest", "turning"])
@pytest.mark.parametrize("name", SCENES)
def test_light_is_the_processors(name: str, gaze: Gaze | None) -> None:
    scene = SCENES[name]()
    wanted, found = scene.radiance(3, 40, gaze), scene.radiance(3, 40, gaze, device=DEVICE)
    assert found.on_device and found.radiance.device.type == DEVICE and not wanted.on_device
    np.testing.assert_array_equal(found.frame, wanted.frame)
    scale = np.ptp(wanted.radiance)
    apart = (found.radiance.cpu().numpy() - wanted.radiance) / scale
    rms = float(np.sqrt(np.mean(apart**2)))
    print(f"{name}: {rms:.1e} of full scale rms, {np.abs(apart).max():.1e} at most")
    assert found.radiance.shape == wanted.radiance.shape and found.radiance.dtype == torch.float32
    assert rms < MOST_APART and np.abs(apart).max() < 10 * MOST_APART


def test_planes_of_many_cameras_are_painted_as_alone() -> None:
    disk, other = RotatingDisk(SHAPE), discs()
    scenes = [disk, other, disk.placed((5.0, 9.0), angle=2.0), disk.lit(0.5), other]
    planes = [scene.plane(n, n + 20, TURNED if n % 2 else None) for n, scene in enumerate(scenes)]
    for found, alone in zip(planes_on(planes, DEVICE), painted_planes(planes), strict=True):
        assert np.abs(found.radiance.cpu().numpy() - alone.radiance).max() < 1e-3 * alone.radiance.max()


def test_a_device_that_is_not_there_is_refused() -> None:
    for scene in (RotatingDisk(SHAPE), SlidingTexture(SHAPE)):
        with pytest.raises(InputError, match="device"):
            scene.radiance(0, 4, device="cuda:99")
