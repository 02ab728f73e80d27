"""The sensor of a frame camera: from the light of an exposure to the numbers of its converter.

    electrons = Poisson(s N L E + dark)                  L: light, E: exposure [frames], N: electrons of a spike's light
    signal    = min(electrons, full well) + Normal(0, read noise) - dark
    number    = signal (2^bits - 1) / (s N white E)      rounded, from 0 to 2^bits - 1
    s         = min(1, full well / (N white E))          neutral filter: `white` just fills the well

`white` is the light of the largest number.  Light that is too much for the well meets a filter; in the dark there is
none, and the amplifier's gain makes the number.  The mean dark charge is subtracted, as cameras do by covered pixels.
So variance and mean are those of EMVA 1288, K the gain:

    variance = K mean + K^2 (dark + read noise^2) + 1/12

Sources: EMVA Standard 1288, release 4 Linear (2021): model and photon transfer.  Values: at each sensor below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.ranges import check_parameters, parameter
from spikecam_env.types import Floats


@dataclass(frozen=True)
class FrameSensor:
    """Parameters of a frame camera's sensor.

    The defaults are a machine-vision sensor with a global shutter, Sony IMX255 (pixels of 3.45 um).  EMVA 1288 by the
    manual of the camera mvBlueFOX3: SNR 40.3 dB is a well of 10 700 electrons; with a dynamic range of 71.3 dB, read
    noise is 2.4.  Moravian Instruments measured 11 000 and 2.2 for the same pixel (manual of the C1+).

    Raises:
        InputError: for a value outside its range.

    Example:
        >>> FrameSensor(bits=12).read_noise
        2.4
        >>> FrameSensor().share_let_through(white=1.0, exposure_frames=1333.0) < 2e-4
        True
    """

    spike_electrons: float = parameter(
        50_000.0,
        unit="electrons",
        bounds=(2.0, 1e12),
        doc="electrons of the light of one spike: the quanta of shot noise in preset scsim, as of SCSim's script",
    )
    read_noise: float = parameter(
        2.4, unit="electrons", bounds=(0.0, 1e5), doc="standard deviation of the noise of a read-out"
    )
    full_well: float = parameter(
        10_700.0, unit="electrons", bounds=(100.0, 1e9), doc="electrons that a pixel holds at most"
    )
    dark_current: float = parameter(
        125.0,
        unit="electrons/s",
        bounds=(0.0, 1e9),
        doc="dark charge of a second; specification of the global-shutter sensor CMV12000 at 25 degrees",
    )
    bits: int = parameter(10, unit="bits", bounds=(1, 16), doc="of the analogue-to-digital converter")

    def __post_init__(self) -> None:
        check_parameters(self, "frame_sensor")

    @property
    def largest(self) -> int:
        """Largest number of the converter."""
        return int(2**self.bits - 1)

    def share_let_through(self, white: float, exposure_frames: float) -> float:
        """Share of the light that the filter lets through."""
        return min(1.0, self.full_well / (self.spike_electrons * white * exposure_frames))

    def numbers(
        self,
        light: Floats,
        white: float,
        exposure_frames: float,
        frame_rate_hz: float,
        rng: np.random.Generator | None,
    ) -> Floats:
        """Numbers of the converter after an exposure.

        Args:
            light: mean light of the exposure, any shape; 1.0 makes the nominal pixel fire once a frame.
            white: light of the largest number.
            exposure_frames: exposure, in frames of the spike camera.
            frame_rate_hz: of these frames.
            rng: of the noise; None for no noise.

        Returns:
            Whole numbers from 0 to `largest`, of the light's shape.

        Example:
            >>> FrameSensor(bits=8).numbers(np.array([0.0, 0.5, 2.0]), 1.0, 40.0, 40_000.0, None).tolist()
            [0.0, 128.0, 255.0]
        """
        seen = self.share_let_through(white, exposure_frames) * self.spike_electrons * exposure_frames
        dark = self.dark_current * exposure_frames / frame_rate_hz
        mean = np.minimum(seen * np.asarray(light, np.float64) + dark, 2.0 * self.full_well)  # fills any well
        electrons = mean if rng is None else rng.poisson(mean)
        signal = np.minimum(electrons, self.full_well) - dark
        if rng is not None:
            signal = signal + self.read_noise * rng.standard_normal(signal.shape)
        return np.clip(np.floor(signal * (self.largest / (seen * white)) + 0.5), 0.0, self.largest)


HIGH_SPEED = FrameSensor(read_noise=3.04, full_well=7600.0)
"""A sensor with a global shutter at up to 1141 frames a second, ForzaFAST581.  Read noise is that at the highest rate;
the well is it times the dynamic range, 68 dB.  Source: Agarwal et al., High-Frame-Rate Low-Noise Global Shutter CMOS
Image Sensor for High-Speed Machine Vision, PMC12944688."""
