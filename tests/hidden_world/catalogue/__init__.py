"""The effects that a diagnosis knows by name, each written anew from its one-line description, a stage a file.

Each has a `near` law, the plain sense of the description, and `far` ones: other forms that textbooks have of
the same thing (docs/blind_trial.md has their table).
"""

from __future__ import annotations

from tests.hidden_world.catalogue import base, optics, photodiode, readout, reset, threshold
from tests.hidden_world.mechanism import Mechanism, limits

_found = {m.name: m for stage in (optics, photodiode, threshold, reset, readout) for m in stage.MECHANISMS}

CATALOGUE: dict[str, Mechanism] = {name: _found[name] for name in limits() if name in _found}
"""In the order of limits.toml, which the seeds of a trial's cases go by."""

BASE_EFFECTS: dict[str, Mechanism] = {m.name: m for m in base.MECHANISMS}
"""The base model's own."""
