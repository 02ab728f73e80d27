"""Effects of a user's own: loaded from a file, refused in words, taken by models, options and other processes."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from effect_file import written

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor, effects_from, load_effects, load_installed_effects
from spikecam_env.sensor.declaration import check_declaration
from spikecam_env.sensor.effect_law import law_digest
from spikecam_env.sensor.effect_sheet import Sheet


@pytest.fixture
def catalogue() -> Iterator[None]:
    """Leaves the catalogue as it was."""
    with effects_from():
        yield


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return written(tmp_path / "grey_filter.py")


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_of_the_package_is_declared_as_a_users_must_be(name: str) -> None:
    check_declaration(CATALOGUE[name])


def test_an_effect_of_a_file_is_one_like_any_other(file: Path) -> None:
    before = list(CATALOGUE)
    with effects_from(file) as [grey]:
        assert set(CATALOGUE) == {*before, "grey_filter"}
        assert list(CATALOGUE.values()) == sorted(CATALOGUE.values(), key=lambda e: (e.stage, e.name))
        assert Sheet.of(grey).twins == ("vignetting",)
        model = SensorModel.preset("ideal").with_effect(grey(loss=0.5))
        rate = SpikeSensor(model, (4, 4), engine="auto").step(np.full((4, 4), 0.2), 2000).mean()
        assert rate == pytest.approx(0.1, abs=1 / 2000)
    assert list(CATALOGUE) == before


def test_a_file_is_run_once_and_again_when_it_was_edited(file: Path, catalogue: None) -> None:
    [first] = load_effects(file)
    assert load_effects(str(file)) == (first,)
    written(file, ("(0.05,", "(0.07,"))
    [edited] = load_effects(file)
    assert edited is not first and CATALOGUE["grey_filter"] is edited and edited().loss == 0.07
    other = written(file.with_name("other.py"))
    with pytest.raises(InputError, match=r"other.py: there is an effect grey_filter already \(.*grey_filter.py\)"):
        load_effects(other)


LAST = "        return light.scaled(1.0 - self.loss), dark, memory\n"
WRONG = {
    "no effect": ("class GreyFilter(Effect):", "class GreyFilter:", "has no effect"),
    "name in the catalogue": ("GreyFilter", "DeadTime", "there is an effect dead_time already .*dead_time"),
    "no plain name": ("GreyFilter", "_Grey", "effect _grey: its class _Grey has no plain name"),
    "not a dataclass": ("@dataclass(frozen=True)\n", "", "it is no frozen dataclass"),
    "not frozen": ("(frozen=True)", "", "line 1[0-9]: TypeError: cannot inherit non-frozen"),
    "no stage": ("    stage = Stage.OPTICS\n", "", "it has no stage; write stage = Stage.X, one of OPTICS"),
    "stage in text": ("Stage.OPTICS", '"optics"', "it has no stage"),
    "strength unknown": ('strength = "loss"', 'strength = "los"', "unknown strength of grey_filter 'los'.*loss"),
    "no strength": ('    strength = "loss"\n', "", "unknown strength of grey_filter None"),
    "a plain field": ('parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share that is lost")', "0.05",
                      "loss has no unit and bounds"),
    "no default": ("(0.05, unit", "(unit", "loss has no default"),
    "no bounds": ("bounds=(0.0, 1.0), ", "", "loss has no bounds"),
    "a switch": ("0.05, unit", "True, unit", "its strength loss is a switch"),
    "default out of bounds": ("0.05, unit", "1.5, unit", "grey_filter.loss = 1.5; it must be a number from 0 to 1"),
    "zero not allowed": ("(0.0, 1.0)", "(0.01, 1.0)", "grey_filter.loss = 0.0; it must be"),
    "no law": ("    x <- x (1 - loss)\n", "", "no indented equation"),
    "identification of another kind": ("Identification(needs=Needs.STEADY)", "{}", "its identification is none"),
    "needs in text": ("needs=Needs.STEADY", 'needs="steady"', "its identification is none"),
    "fitted unknown": ("needs=Needs.STEADY", 'fitted=("loss", "tau")', "unknown parameter of grey_filter .*'tau'"),
    "shapes unknown": ("needs=Needs.STEADY", 'shapes={"tau": (1.0,)}', "unknown parameter of grey_filter .*'tau'"),
    "shapes out of bounds": ("needs=Needs.STEADY", 'shapes={"loss": (2.0,)}', "loss = 2.0; it must be"),
    "shapes empty": ("needs=Needs.STEADY", 'shapes={"loss": ()}', "shapes of loss are empty"),
    "share of nothing": ("needs=Needs.STEADY", 'share=("loss", "photons")', "unknown kind of share .*'photons'"),
    "step of zero": ("needs=Needs.STEADY", "shape_step=0.0", "shape_step = 0.0"),
    "unknown entry": ("needs=Needs.STEADY", "need=Needs.STEADY", "TypeError: .*need"),
    "no hook": ("def collect", "def colect", "it has no hook, so that it does nothing; write one of imprint"),
    "memory alone": ("def collect(self, light, dark, now, memory)", "def begin(self, light, dark, now)",
                     "it has no hook, so that it does nothing"),
    "sway alone": (LAST, f"{LAST}\n    def sway(self, now, phase, beside):\n        raise ValueError\n",
                   "its hook sway does nothing without parts; write parts too"),
    "parts alone": (LAST, f"{LAST}\n    def parts(self, rate):\n        raise ValueError\n",
                    "its hook parts does nothing without sway; write sway too"),
    "syntax": ("    strength =", "    strength", "line 2[0-9]: SyntaxError"),
    "import": ("from dataclasses import dataclass", "import no_such_module", "line 10: ModuleNotFoundError"),
    "raises": ("@dataclass(frozen=True)", "1 / 0", "line 1[0-9]: ZeroDivisionError: division by zero"),
    "leaves": ("@dataclass(frozen=True)", "raise SystemExit(3)", "line 1[0-9]: SystemExit: 3"),
    "never ends": ("@dataclass(frozen=True)", "f = lambda: f()\nf()", "line 1[0-9]: RecursionError"),
}  # fmt: skip


@pytest.mark.parametrize("old, new, said", WRONG.values(), ids=WRONG)
def test_what_is_wrong_in_a_file_is_said_in_a_line(old: str, new: str, said: str, file: Path, capsys) -> None:
    before, modules = dict(CATALOGUE), set(sys.modules)
    written(file, (old, new))
    with pytest.raises(InputError, match=said) as error:
        load_effects(file)
    assert str(file) in str(error.value) and "\n" not in str(error.value)
    assert before == CATALOGUE
    assert run(["effects", "list", "--effect-file", str(file)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    if "line" in said:  # a module that failed in the middle is not kept
        assert set(sys.modules) == modules


def test_ctrl_c_while_a_file_is_run_ends_the_command(file: Path) -> None:
    written(file, ("@dataclass(frozen=True)", "raise KeyboardInterrupt"))
    with pytest.raises(KeyboardInterrupt):
        load_effects(file)


def test_a_model_file_says_which_effect_file_it_needs(file: Path, tmp_path: Path) -> None:
    with effects_from(file) as [grey]:
        model = SensorModel.preset("scsim").with_effect(grey(loss=0.25))
        model.to_toml(tmp_path / "model.toml")
        assert SensorModel.from_toml(tmp_path / "model.toml") == model
    assert (tmp_path / "model.toml").read_text().startswith("# needs --effect-file grey_filter.py\n")
    with pytest.raises(InputError, match=r"unknown effect 'grey_filter'.*one of your own needs|of your own"):
        SensorModel.from_toml(tmp_path / "model.toml")


def test_commands_take_a_model_of_it_with_its_file_and_refuse_it_without(file: Path, tmp_path: Path, capsys) -> None:
    small = ["--size", "8", "8", "--frames", "40"]
    here = ["--effect-file", str(file)]
    campaign = ["campaign", "simulate", str(tmp_path / "camera"), "--shape", "8", "8", "--frames", "40"]
    assert run([*campaign, "--recording", "dark", "--effect", "grey_filter:loss=0.3", *here]) == 0
    model = ["--model", str(tmp_path / "camera" / "model.toml")]
    assert run(["record", "--out", str(tmp_path / "a.npz"), *small, *model, *here]) == 0
    capsys.readouterr()
    assert run(["record", "--out", str(tmp_path / "b.npz"), *small, *model]) == 2
    assert "--effect-file" in capsys.readouterr().err and not (tmp_path / "b.npz").exists()
    assert run(["effects", "show", "grey_filter", *here]) == 0
    assert "x <- x (1 - loss)" in capsys.readouterr().out
    assert "grey_filter" not in CATALOGUE


def test_another_process_loads_the_file_by_itself(file: Path, catalogue: None) -> None:
    """As a worker of a dataset that is spawned does."""
    [grey] = load_effects(file)
    model = SensorModel.preset("scsim").with_effect(grey(loss=0.25))
    code = (
        "import pickle, sys; from spikecam_env.sensor import CATALOGUE; from dataclasses import replace;"
        "model = pickle.load(sys.stdin.buffer); replace(model, name='other');"
        "print(model.effects[0], 'grey_filter' in CATALOGUE)"
    )
    done = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(model), capture_output=True)
    assert done.stdout.decode().strip() == "GreyFilter(loss=0.25) True", done.stderr.decode()
    assert pickle.loads(pickle.dumps(model)) == model == copy.deepcopy(model)
    held = pickle.dumps(model)
    written(file, ("(0.05,", "(0.06,"))
    done = subprocess.run([sys.executable, "-c", code], input=held, capture_output=True)
    assert "has changed since grey_filter was saved" in done.stderr.decode()


class _Package:
    """An entry point: of a module, as `load` gives it, or of one that fails."""

    name, value = "mine", "mine.effects"

    def __init__(self, loaded: object) -> None:
        self.loaded = loaded

    def load(self) -> object:
        if isinstance(self.loaded, Exception):
            raise self.loaded
        return self.loaded


def test_packages_offer_effects_and_one_that_fails_is_left_out(file: Path, monkeypatch, catalogue: None) -> None:
    with effects_from(file) as [grey]:
        pass
    asked = []
    offered = [_Package(ImportError("no such thing")), _Package(sys.modules[grey.__module__]), _Package(3)]
    monkeypatch.setattr(metadata, "entry_points", lambda group: asked.append(group) or offered)
    with pytest.warns(UserWarning, match="left out") as warned:
        assert load_installed_effects() == (grey,)
    assert asked == ["spikecam.effects"] and CATALOGUE["grey_filter"] is grey
    assert [str(w.message).split("left out: ")[1] for w in warned] == [
        "ImportError: no such thing",
        "spikecam_env.errors.InputError: 3 is no class of Effect",
    ]


def test_a_law_is_the_same_however_it_is_written_and_another_when_it_computes_another_thing(file: Path) -> None:
    def digest(*changes: tuple[str, str]) -> str:
        with effects_from(written(file, *changes)) as [grey]:
            return law_digest(grey)

    law = digest()
    assert digest(("Grey filter: a share", "Something else: a share")) == law
    assert digest(('    strength = "loss"', '    strength = "loss"  # a comment')) == law
    assert digest(("share that is lost", "other words")) == law
    assert digest(("needs=Needs.STEADY", 'needs=Needs.STEADY, experiment="flats"')) == law
    assert digest(("1.0 - self.loss", "1.0 - 2.0 * self.loss")) != law
    assert digest(("(0.0, 1.0)", "(0.0, 0.9)")) != law
    assert digest(("0.05", "0.06")) != law
