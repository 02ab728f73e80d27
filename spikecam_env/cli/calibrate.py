"""`spikecam calibrate`: SNEE, a camera's noise from recordings of known flat light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from spikecam_env.numbers import Positive

if TYPE_CHECKING:
    from spikecam_env.calibration.findings import Finding


@dataclass
class Calibrate:
    """Estimate a camera from flats at known levels (SNEE): model.toml, maps.h5 and report.html.

    example:  spikecam calibrate flats --out calibrated
    """

    campaign: tyro.conf.Positional[Path]
    """Folder with a campaign.json (format spikecam-campaign/1)."""
    out: Path
    """Folder for the results."""
    reset_noise_mv: Positive | None = None
    """Reset noise to assume where all recordings have one V_d; default sqrt(kT/C)."""
    outside: bool = False
    """Also read files of the campaign that lie outside its folder."""

    def run(self) -> None:
        from spikecam_env.calibration import calibrate, findings, save_calibration
        from spikecam_env.campaign import read_campaign
        from spikecam_env.cli.files import out_folder
        from spikecam_env.cli.table import table

        campaign = read_campaign(self.campaign, outside=self.outside)
        with out_folder(self.out) as folder:
            calibration = calibrate(campaign, reset_noise_mV=self.reset_noise_mv, progress=True)
            written = save_calibration(calibration, folder)
        print(table([_row(finding) for finding in findings(calibration)]))
        for warning in calibration.warnings:
            print(f"note: {warning}")
        for path in written:
            print(f"wrote {self.out / path.name}")


def _row(f: Finding) -> dict[str, str]:
    return {"quantity": f.quantity, "value (90 %)": f.text, "unit": f.unit or "-", "status": f.status, "from": f.basis}
