"""The catalogue of effects as pages, made from the effects' own declarations.

    python -m tools.effects_page docs/effects.md

writes the table of all effects there, and the law of each to `docs/effects/STAGE.md`.
"""

from __future__ import annotations

import inspect
import sys
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any

from spikecam_env.sensor.effect_sheet import Sheet
from spikecam_env.sensor.effects import CATALOGUE, Effect, Stage
from spikecam_env.sensor.model import SensorModel
from spikecam_env.sensor.ranges import range_text
from spikecam_env.sensor.unit import LEAST_SHARE, MOST_KAPPA, MOST_SPREAD, SWING_V, Circuit
from spikecam_env.whole import write_text_whole


def pages() -> dict[str, str]:
    """Markdown of every page by its path from docs: the table of all effects, and a page for each stage."""
    stages = {stage: [e for e in CATALOGUE.values() if e.stage is stage] for stage in Stage}
    table = "\n".join([_HEAD, _table(stages), _camera(), _TAIL, _toctree()])
    return {"effects.md": table, **{path_of(stage): _chapter(stage, of) for stage, of in stages.items()}}


def main() -> None:
    """Write the pages beside the file named on the command line; each appears whole."""
    if len(sys.argv) != 2 or Path(sys.argv[1]).name != "effects.md":
        raise SystemExit("usage: python -m tools.effects_page docs/effects.md")
    docs = Path(sys.argv[1]).parent
    (docs / "effects").mkdir(exist_ok=True)
    for path, text in pages().items():
        write_text_whole(docs / path, text)


def path_of(stage: Stage) -> str:
    """Path of a stage's page from docs."""
    return f"effects/{stage.name.lower()}.md"


def _table(stages: dict[Stage, list[type[Effect]]]) -> str:
    rows = [
        f"| [{_title(stage)}]({path_of(stage)}) | [`{e.name}`]({path_of(stage)}#{e.name}) | {Sheet.of(e).summary} |"
        for stage, of in stages.items()
        for e in of
    ]
    return "\n".join(["| stage | effect | summary |", "|---|---|---|", *rows, ""])


def _toctree() -> str:
    return "\n".join(["```{toctree}", ":hidden:", "", *(path_of(stage)[:-3] for stage in Stage), "```", ""])


def _camera() -> str:
    declared = [*fields(Circuit), *(f for f in fields(SensorModel) if "bounds" in f.metadata)]
    return "\n".join([_CAMERA, *_PARAMETERS, *map(_row, declared), ""])


def _chapter(stage: Stage, effects: list[type[Effect]]) -> str:
    return "\n".join([f"# {_title(stage).capitalize()}", "", _CHAPTER, *map(_entry, effects)])


def _entry(effect: type[Effect]) -> str:
    sheet = Sheet.of(effect)
    said = [f"- {name}: {text}" for name, text in sheet.sections.items() if name != "Stage"]
    return "\n".join(
        [
            f"## {effect.name}",
            "",
            sheet.summary,
            "",
            "```",
            inspect.cleandoc(sheet.law),
            "```",
            "",
            *_PARAMETERS,
            *(_row(f, effect) for f in fields(effect)),
            "",
            *said,
            f"- Engines: {engines(effect)}",
            "",
        ]
    )


def engines(effect: type[Effect]) -> str:
    """Which engines carry an effect, in words."""
    if effect.is_fixed():
        return "all"
    return "reference, fast" if effect.is_compiled() else "reference"


def _row(f: Field[Any], effect: type[Effect] | None = None) -> str:
    is_strength = effect is not None and f.name == effect.strength
    strength = f"; **strength**, {effect.neutral:g} changes nothing" if effect is not None and is_strength else ""
    default = f"{f.default:.5g}" if isinstance(f.default, float) else str(f.default).lower()
    if f.default is MISSING:
        default = ""
    return f"| `{f.name}` | {default} | {f.metadata['unit']} | {range_text(f)} | {f.metadata['doc']}{strength} |"


def _title(stage: Stage) -> str:
    return {Stage.READOUT: "read-out"}.get(stage, stage.name.lower())


_PARAMETERS = ("| parameter | default | unit | bounds | meaning |", "|---|---|---|---|---|")

_CAMERA = f"""## Circuit and frame rate

Every value is checked against its bounds when a circuit, an effect or a model is made; so are their combinations.
The swing reset_V - reference_V + bias_V is {SWING_V[0]:g} to {SWING_V[1]:g} V. The spread of swings over pixels is at
most {MOST_SPREAD:g} of the swing, that of capacitances {MOST_SPREAD:g} of the capacitance, the noise of a reset
{MOST_KAPPA:g} of the swing. A single pixel of a spread keeps {LEAST_SHARE:g} of the nominal swing and capacitance.
[Decisions](decisions.md) has the reasons.
"""

_HEAD = """# Effects

Effects act in physical order, in whatever order a model lists them. The page of a stage has the law of each effect, its
parameters, its twins and its source; [adding an effect](#adding-an-effect) is below.

This page and those of the stages are made by `python -m tools.effects_page docs/effects.md` from the effects' files in
`spikecam_env/sensor/effects`, and a test compares them: edit those files, not the pages.
"""

_CHAPTER = """x is the charge of a frame over the threshold phi; T is the mean interval in frames; N counts the
electrons to a threshold; kappa is the relative noise of a spike's threshold; A_k is E[(t_(n+2k) - 2 t_(n+k) + t_n)^2]
of spike times t. Each entry states the strength at which no bit changes. [Effects](../effects.md) has the table of all.
"""

_TAIL = '''## Adding an effect

[Your own effect](own_effect.md) adds one outside the package. Inside it an effect is one new file, for example
`spikecam_env/sensor/effects/slow_shutter.py`:

```python
"""Slow shutter: the light comes on over the first frames.

    x <- x (1 - exp(-t/tau))

Stage: optics.  Seen in: the first frames of a recording.  Twins: lamp_drift.
Within a frame: integrated over the frame.
Source: a shutter's data sheet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spikecam_env.sensor.effects.base import (
    Acts,
    Charge,
    Effect,
    ExposureBlock,
    Stage,
    parameter,
)
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.frame_moments import mean_decay


@dataclass(frozen=True)
class SlowShutter(Effect):
    tau_us: float = parameter(500.0, unit="us", bounds=(0.0, 1e6), doc="time to open")

    stage = Stage.OPTICS
    acts = Acts.INTEGRATED
    strength = "tau_us"
    identification = Identification(
        family="light",
        needs=Needs.STEADY,
        experiment="recordings begun after the shutter",
    )

    def collect(
        self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any
    ) -> tuple[Charge, Charge, Any]:
        tau = 1e-6 * self.tau_us * now.frame_rate_hz
        opened = 1.0 - mean_decay(now.start, tau) if tau else 1.0
        return light.scaled(opened), dark, memory
```

Nothing else is needed. The catalogue finds the file; `SensorModel.with_effect(CATALOGUE["slow_shutter"](tau_us=200.0))`
and `[[effect]]` in a model file accept it; `engine="auto"` picks an engine that supports it; and the pages get its
entry when they are made again. `acts` declares how the effect acts within a frame, and its docstring states the
accuracy: charge is integrated over the frame, not sampled at its middle. `now.start` is the start of each frame, and
`spikecam_env/sensor/frame_moments.py` has closed forms. With `wants_rise = True` a `Charge` holds the rise of light
within the frame, and a frame with keys inside is given piece by piece. `off_the_line` returns an effect's error in such
a frame; beyond 1 % the frame is refused.

The tests in `tests/sensor/effects/test_every_effect.py` check from the declaration alone: strength zero changes no bit,
alone and among all others; hooks change nothing in place; the bits are the same however a stream is cut, saved and
restored; docs, bounds and declaration are in order, and the named twins exist; and there is a test
`test_slow_shutter_...` of the law, which you write.

| hook | for | cost and engines |
|---|---|---|
| `imprint`, `image` | a fixed pattern; static optics | none a frame; every engine |
| `collect`, `compare`, `read_out` | charge, threshold, bits, whatever fires | blocks of frames; reference and fast |
| `react`, `after_reset`, `spiked` | reactions to spikes | frame by frame; reference, and fast with `feedback` |

Blocks are arrays of (frames, rows, columns). Reactions are declared in `feedback` for the fast engine. Without that
declaration it refuses the effect by name, and `engine="auto"` takes the reference.
A `Charge` holds a picture and a number a frame separately: `light.scaled(numbers)` costs nothing a pixel,
`dark.plus(Few(pixels, charge))` only these few pixels, and `Charge(f(light.values))` an array.

`begin` makes an effect's memory; each hook gets it and returns it. By default it is a random generator of the effect's
own, so that no other effect's draws change. `begin` draws properties of the unit, such as the pixels with a trap, from
`pattern`, the same in all recordings of one unit. Time is `now.number`, absolute, never a count of calls.
'''


if __name__ == "__main__":
    main()
