"""`spikecam calibrate`: SNEE, a camera's noise from recordings of known flat light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from spikecam_env.cli.options import Positive


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
    """Reset noise taken as known where there is one V_d; default sqrt(kT/C)."""
    outside: bool = False
    """Read files of the campaign that lie outside of its folder too."""

    def run(self) -> None:
        from spikecam_env.calibration import calibrate, findings, read_campaign, save_calibration
        from spikecam_env.cli.table import table

        campaign = read_campaign(self.campaign, outside=self.outside)
        calibration = calibrate(campaign, reset_noise_mV=self.reset_noise_mv, progress=True)
        rows = [
            {"quantity": f.quantity, "value (90 %)": f.text, "unit": f.unit or "-", "status": f.status, "from": f.basis}
            for f in findings(calibration)
        ]
        print(table(rows))
        for warning in calibration.warnings:
            print(f"note: {warning}")
        for path in save_calibration(calibration, self.out):
            print(f"wrote {path}")
