"""Hooks of a user's own effects: whatever they return or do is one error that names effect, hook and frame."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from effect_file import written

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError, OwnCodeError
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor, SpikeSensorBatch, effects_from, step_together
from spikecam_env.sensor.effects.base import Effect
from spikecam_env.sensor.own_hooks import CHECKS

SHAPE, FRAMES, BEFORE = (4, 6), 8, 3
"""The array, frames of a step, and frames that pass before the first wrong one."""

GOOD_COLLECT = "        return light.scaled(1.0 - self.loss), dark, memory\n"
GOOD = "    def collect(self, light, dark, now, memory):\n" + GOOD_COLLECT
IMPORTS = """
import os
import sys
from spikecam_env.sensor.effects.base import Bend, Charge, Feedback, Few, Shift
import numpy as np
"""

SIGNATURES = {
    "imprint": "pixels, rng",
    "image": "radiance",
    "begin": "first, pattern, rng",
    "collect": "light, dark, now, memory",
    "compare": "now, memory",
    "parts": "frame_rate_hz",
    "kinks": "first",
    "sway": "now, phase, beside",
    "lead": "first",
    "read_out": "spikes, now, memory",
    "react": "threshold, now, memory",
    "after_reset": "residual, rate, now",
    "spiked": "charge, spikes, rate, now, memory",
    "feedback": "first",
}


def law(hook: str, *lines: str) -> str:
    return f"    def {hook}(self, {SIGNATURES[hook]}):\n" + "".join(f"        {line}\n" for line in lines)


def from_frame(expression: str, good: str) -> str:
    """Wrong in one frame alone: BEFORE frames after the start."""
    return f"return np.where(now.start == {BEFORE}, {expression}, {good})"


NAN_AT = f"np.where(now.start == {BEFORE}, np.nan, 1.0)"
SWAYING = law("parts", "return 4")
NOTHING = "    def begin(self, first, pattern, rng):\n        return None\n"

WRONG = {
    # compare: its value
    "NaN": (law("compare", f"return Shift(factor={NAN_AT}), memory"), "compare, frame 3: factor is nan"),
    "infinite": (law("compare", "return Shift(millivolts=np.inf), memory"), "compare, frame.*: millivolts is inf"),
    "far too large": (law("compare", "return Shift(factor=1e300), memory"), "compare, .*factor is 1e\\+300"),
    "none": (law("compare", "pass"), "compare, .*it returned a NoneType; it must return \\(shift, memory\\)"),
    "not a pair": (law("compare", "return Shift()"), "compare, .*it returned a Shift"),
    "three": (law("compare", "return Shift(), memory, 1"), "compare, .*it returned 3 values"),
    "another kind": (law("compare", "return 1.0, memory"), "compare, .*the shift is a float; it must be a Shift"),
    "complex": (law("compare", "return Shift(factor=np.ones((1, 4, 1), complex)), memory"), "factor is complex128"),
    "complex number": (law("compare", "return Shift(factor=1j), memory"), "factor is 1j"),
    "objects": (law("compare", "return Shift(factor=np.full((1, 4, 1), None)), memory"), "factor is object"),
    "text": (law("compare", "return Shift(factor='1'), memory"), "compare, .*factor is '1'"),
    "masked": (
        law("compare", "return Shift(factor=np.ma.masked_equal(np.ones((now.frames, 1, 1)), 1.0)), memory"),
        "compare, .*factor is an array with masked values",
    ),
    "wrong rows": (law("compare", "return Shift(factor=np.ones((1, 5, 1))), memory"), r"shape \(1, 5, 1\)"),
    "wrong frames": (law("compare", "return Shift(factor=np.ones((now.frames + 1, 1, 1))), memory"), "has shape"),
    "no time axis": (law("compare", "return Shift(factor=np.ones(now.shape)), memory"), r"shape \(4, 6\)"),
    "huge": (
        law("compare", "return Shift(factor=np.broadcast_to(1.0, (1 << 20, 1 << 20, 64))), memory"),
        "factor has shape",
    ),
    # errors and exits
    "raises": (law("compare", "1 / 0"), r"compare, frame.*\(line \d+\): ZeroDivisionError: division by zero"),
    "raises text of many lines": (law("compare", "raise ValueError('a\\nb')"), "ValueError: a b"),
    "raises an error without text": (
        law("compare", "class E(Exception):", "    def __str__(self): return 1 / 0", "raise E"),
        "exception str\\(\\) failed",
    ),
    "leaves": (law("compare", "sys.exit(3)"), "compare, .*SystemExit: 3"),
    "leaves well": (law("compare", "sys.exit(0)"), "compare, .*SystemExit: 0"),
    "breaks a pipe": (law("compare", "raise BrokenPipeError"), "compare, .*BrokenPipeError"),
    "has no disk": (law("compare", "raise OSError(28, 'No space left on device')"), "compare, .*OSError.*No space"),
    "stops iterating": (law("compare", "next(iter(()))"), "compare, .*StopIteration"),
    "recurs": (law("compare", "return self.compare(now, memory)"), "compare, .*RecursionError"),
    "runs out of memory": (law("compare", "raise MemoryError('much')"), "compare, .*MemoryError: much"),
    "takes too few arguments": ("    def compare(self):\n        pass\n", "compare, .*TypeError: .*compare"),
    "is no function": ("    compare = 3\n", "compare, .*TypeError: 'int' object is not callable"),
    "writes to a closed stream": (
        law("compare", "f = open(os.devnull, 'w')", "f.close()", "print('x', file=f)"),
        "compare, .*I/O operation on closed file",
    ),
    # the other hooks
    "imprint": (law("imprint", "pixels.gain[0, 0] = 2.0", "return pixels"), "imprint.*read-only"),
    "imprint NaN": (
        law("imprint", "from dataclasses import replace", "return replace(pixels, gain=pixels.gain * np.nan)"),
        r"imprint: gain is nan at \(0, 0\)",
    ),
    "imprint without swing": (
        law("imprint", "from dataclasses import replace", "return replace(pixels, swing_V=0 * pixels.swing_V)"),
        "imprint: swing_V is 0",
    ),
    "imprint none": (law("imprint", "pass"), "imprint: the value is a NoneType"),
    "image": (law("image", "return radiance[:2]"), r"image: the picture has shape \(2, 6\)"),
    "image NaN": (law("image", "return radiance / 0 - radiance / 0"), "image: the picture is nan at"),
    "image negative": (law("image", "return -radiance"), "image: the picture is -0.5"),
    "image in place": (law("image", "radiance *= 0.5", "return radiance"), "image .line.*read-only"),
    "begin": (law("begin", "return lambda: 1") + GOOD, "begin, frame 0: the memory, a function, cannot be pickled"),
    "collect": (law("collect", "return light.values, dark, memory"), "collect, .*light is a ndarray"),
    "collect NaN": (
        law("collect", f"return Charge(light.values * {NAN_AT}), dark, memory"),
        r"collect, frame 3: pixels of light is nan at \(0, 0\)",
    ),
    "collect in place": (law("collect", "light.pixels[:] = 0", "return light, dark, memory"), "collect.*read-only"),
    "collect few": (
        law("collect", "return light, dark.plus(Few(np.array([99]), np.ones((now.frames, 1)))), memory"),
        "few of dark|IndexError",
    ),
    "collect few as said": (
        law(
            "collect",
            "few = Few(np.array([99]), np.ones((now.frames, 1)))",
            "return light, Charge(dark.pixels, few=few), memory",
        ),
        "few of dark: pixels are 99 to 99; they must be from 0 to 23",
    ),
    "sway": (SWAYING + law("sway", "return Shift(millivolts=np.nan)"), "sway, .*millivolts is nan"),
    "sway shape": (SWAYING + law("sway", "return Shift(factor=np.ones((1, 9, 2)))"), "sway, .*factor has shape"),
    "parts": (law("parts", "return 1.5") + law("sway", "return Shift()"), "parts.*'float' object"),
    "parts negative": (law("parts", "return -1") + law("sway", "return Shift()"), "parts: parts are -1"),
    "kinks": (SWAYING + law("kinks", "return (1.5,)") + law("sway", "return Shift()"), "kinks, .*a kink is 1.5"),
    "lead": (SWAYING + law("lead", "return 7.0") + law("sway", "return Shift()"), "lead, .*the lead is 7.0"),
    "read_out": (law("read_out", "return spikes * 2, memory"), "read_out, .*spikes is int64; .* true and false"),
    "read_out shape": (law("read_out", "return spikes[:, :2], memory"), "read_out, .*spikes have|has shape"),
    "read_out in place": (law("read_out", "spikes[:] = True", "return spikes, memory"), "read_out.*read-only"),
    "feedback": (law("feedback", "return Feedback(kept=float('nan'))") + GOOD, "feedback, .*kept is nan"),
    "feedback time": (law("feedback", "return Feedback(left_tau=0.0)") + GOOD, "feedback, .*left_tau is 0"),
    "feedback none": (law("feedback", "pass") + GOOD, "feedback, .*the value is a NoneType"),
    "after_reset": (law("after_reset", "return residual * np.nan"), "after_reset, frame .*: the charge is nan"),
    "after_reset shape": (law("after_reset", "return 0.0"), "after_reset, .*the charge has shape"),
    "react": (law("react", "return threshold[0]"), "react, frame 0: the thresholds has shape|have shape"),
    "react in place": (law("react", "threshold += 1", "return threshold"), "react, .*read-only"),
    "spiked": (law("spiked", "return charge"), "spiked, frame 0: it returned a ndarray"),
    "spiked NaN": (law("spiked", "return charge / 0.0 * 0.0, memory"), "spiked, frame 0: the charge is nan"),
}  # fmt: skip
REACTS = ("after_reset", "react", "spiked")


def own_file(path: Path, hooks: str) -> Path:
    return written(
        path, (GOOD, hooks), ("from dataclasses import dataclass\n", "from dataclasses import dataclass\n" + IMPORTS)
    )


def engines_of(name: str) -> tuple[str, ...]:
    return ("reference",) if name.startswith(REACTS) else ("reference", "fast")


@pytest.mark.parametrize("engine, name", [(engine, name) for name in WRONG for engine in engines_of(name)])
def test_a_wrong_hook_is_an_error_that_names_effect_hook_and_frame(engine: str, name: str, tmp_path: Path) -> None:
    hooks, said = WRONG[name]
    light = np.full(SHAPE, 0.5, np.float32)
    with effects_from(own_file(tmp_path / "grey_filter.py", hooks)) as [grey], pytest.raises(InputError) as error:
        model = SensorModel.preset("scsim").with_effect(grey())
        SpikeSensor(model, SHAPE, seed=0, engine=engine).step(light, FRAMES)
    print(error.value)
    error.match(f"^effect grey_filter, .*({said})" if not said.startswith("parts") else said)
    assert isinstance(error.value, OwnCodeError) and "\n" not in str(error.value)
    assert light.max() == light.min() == 0.5
    if "raises" in name:
        assert isinstance(error.value.__cause__, Exception)


@pytest.mark.parametrize("name", ["NaN", "none", "raises", "leaves", "breaks a pipe", "collect NaN", "image NaN"])
def test_a_command_with_a_wrong_hook_ends_in_a_line_and_code_2(name: str, tmp_path: Path, capfd) -> None:
    file, out = own_file(tmp_path / "grey_filter.py", WRONG[name][0]), tmp_path / "out.h5"
    line = ["record", "--out", str(out), "--size", "4", "6", "--frames", "8", "--effect", "grey_filter"]
    assert run([*line, "--effect-file", str(file)]) == 2
    said = [line for line in capfd.readouterr().err.splitlines() if line.strip() and "%|" not in line]
    assert len(said) == 1 and said[0].startswith("spikecam: effect grey_filter, "), said
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_hook_that_closes_a_standard_stream_ends_the_command_with_code_2(stream: str, tmp_path: Path) -> None:
    file = own_file(tmp_path / "grey_filter.py", law("compare", f"sys.{stream}.close()", "return Shift(), memory"))
    line = ["record", "--out", str(tmp_path / "out.h5"), "--size", "4", "6", "--frames", "8"]
    words = [*line, "--effect", "grey_filter", "--effect-file", str(file)]
    done = subprocess.run([sys.executable, "-m", "spikecam_env", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    if stream == "stdout":
        assert f"it closed sys.{stream}; leave it open" in done.stderr


def test_batches_name_effect_and_hook(tmp_path: Path) -> None:
    """Of cameras that step together, and of a batch, which takes fixed patterns and optics."""
    lights = [np.full(SHAPE, 0.5)] * 2
    with effects_from(own_file(tmp_path / "grey_filter.py", WRONG["NaN"][0])) as [grey]:
        sensors = [SpikeSensor(SensorModel.preset("scsim").with_effect(grey()), SHAPE, seed) for seed in (0, 1)]
        with pytest.raises(OwnCodeError, match="effect grey_filter, compare, frame 3: factor is nan"):
            step_together(sensors, lights, FRAMES)
    file, said = (
        own_file(tmp_path / "grey_filter.py", WRONG["imprint NaN"][0]),
        "effect grey_filter, imprint: gain is nan",
    )
    with effects_from(file) as [grey], pytest.raises(OwnCodeError, match=said):
        SpikeSensorBatch(SensorModel.preset("scsim").with_effect(grey()), SHAPE, seeds=[0, 1], device="cpu")


def test_ctrl_c_within_a_hook_is_ctrl_c(tmp_path: Path) -> None:
    hooks = law("compare", "raise KeyboardInterrupt")
    with effects_from(own_file(tmp_path / "grey_filter.py", hooks)) as [grey], pytest.raises(KeyboardInterrupt):
        SpikeSensor(SensorModel.preset("ideal").with_effect(grey()), SHAPE).step(np.full(SHAPE, 0.5), FRAMES)


def test_parameters_are_held_to_their_ranges_where_an_effect_makes_itself(tmp_path: Path) -> None:
    hooks = "    def __post_init__(self):\n        if self.loss == 0.5:\n            raise KeyError('half')\n" + GOOD
    with effects_from(own_file(tmp_path / "grey_filter.py", hooks)) as [grey]:
        with pytest.raises(InputError, match="loss = nan; it must be"):
            grey(loss=np.nan)
        with pytest.raises(OwnCodeError, match="effect grey_filter, __post_init__: KeyError: 'half'"):
            grey(loss=0.5)


DRAW_NOTHING = ("supply_ripple", "optical_blur", "vignetting", "photodiode_lag", "blooming", "readout_skew",
                "dead_time", "comparator_delay", "synchronous_reset", "incomplete_reset", "crosstalk", "ir_drop",
                "light_flicker", "clock_feedthrough", "photo_response_nonlinearity", "dark_current_drift")  # fmt: skip


@pytest.mark.parametrize("base", ["ideal", "scsim"])
@pytest.mark.parametrize("engine", ["reference", "auto"])
def test_a_checked_law_gives_the_bits_of_the_same_law_unchecked(base: str, engine: str, tmp_path: Path) -> None:
    """Every shipped effect as a user's own, under another name: it changes no array in place, and keeps shapes.

    The check hands on the values of the law; of effects that draw, another name draws other numbers.
    """
    light = np.random.default_rng(0).uniform(0.0, 1.5, SHAPE)
    for name, shipped in CATALOGUE.items():
        text = Path(inspect.getsourcefile(shipped)).read_text(encoding="utf-8")
        file = tmp_path / f"own_{name}.py"
        file.write_text(text.replace(f"class {shipped.__name__}", f"class {shipped.__name__}s"), encoding="utf-8")
        with effects_from(file) as [own]:
            spikes = [_spikes(SensorModel.preset(base).with_effect(e()), light, engine) for e in (shipped, own)]
        if name in DRAW_NOTHING:
            np.testing.assert_array_equal(*spikes, err_msg=name)


def _spikes(model: SensorModel, light: np.ndarray, engine: str) -> np.ndarray:
    return SpikeSensor(model, SHAPE, seed=2, engine=engine).step(light, 40)


def test_effects_of_the_package_are_called_as_they_are_and_every_hook_of_others_is_checked() -> None:
    for effect in CATALOGUE.values():
        assert not [hook for hook in CHECKS if hasattr(inspect.getattr_static(effect, hook), "unchecked")], effect
    public = {name for name, value in vars(Effect).items() if inspect.isfunction(value) and not name.startswith("_")}
    assert public - {"parameters"} == set(CHECKS)
