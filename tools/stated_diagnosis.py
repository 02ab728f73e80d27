"""A diagnosis as the docs state it: JSON and the model's TOML beside its committed page, without seconds and pictures.

docs/wall_diagnosis.html    the page
docs/wall_diagnosis.json    its figures
docs/wall_diagnosis.toml    its model
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import TypeAdapter

from spikecam_env.gap.report.page import about, use_of_recordings
from spikecam_env.gap.report.reproduce import version_of_code
from spikecam_env.gap.result import Diagnosis, json_value
from spikecam_env.sensor import SensorModel
from spikecam_env.whole import write_text_whole

LEFT_OUT = ("evidence", "motion", "patched", "stages")
"""Fields of a diagnosis that are arrays, a file of their own, or seconds."""


@dataclass(frozen=True)
class StatedDiagnosis:
    """A diagnosis, and the origin of its page."""

    version: str
    """Of the code that made the page."""
    about: str
    """The recordings and the model."""
    campaign_command: str
    """How the campaign was made."""
    used: dict[str, str]
    """`fit` or `holdout`, by the name of a recording."""
    diagnosis: Diagnosis

    @classmethod
    def of(cls, diagnosis: Diagnosis, campaign_command: str) -> StatedDiagnosis:
        """Of a diagnosis that today's code has made."""
        return cls(version_of_code(), about(diagnosis), campaign_command, use_of_recordings(diagnosis), diagnosis)

    @classmethod
    def read(cls, page: Path) -> StatedDiagnosis:
        """From the files beside a page."""
        stated: dict[str, Any] = json.loads(page.with_suffix(".json").read_text(encoding="utf-8"))
        types = get_type_hints(Diagnosis)
        fields = {name: TypeAdapter(types[name]).validate_python(value) for name, value in stated["diagnosis"].items()}
        model = SensorModel.from_toml(page.with_suffix(".toml"))
        return cls(**{**stated, "diagnosis": Diagnosis(**fields, patched=model, stages={})})

    def write(self, page: Path) -> None:
        """Beside a page."""
        plain = replace(self.diagnosis, evidence=None, motion=())
        fields = {name: value for name, value in asdict(plain).items() if name not in LEFT_OUT}
        text = json.dumps({**vars(self), "diagnosis": fields}, indent=1, default=json_value)
        write_text_whole(page.with_suffix(".json"), text + "\n")
        self.diagnosis.patched.to_toml(page.with_suffix(".toml"))
