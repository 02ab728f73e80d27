"""`spikecam effects new` writes an effect and a test that pass as they stand; nothing is overwritten."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, effects_from
from spikecam_env.sensor.beginning import TEMPLATE, class_name, write_new_effect
from spikecam_env.sensor.effects.base import effect_name


def test_what_is_written_passes_its_own_tests(tmp_path: Path, capsys) -> None:
    assert run(["effects", "new", "led_droop", "--out", str(tmp_path / "mine")]) == 0
    said = capsys.readouterr().out
    assert "python -m pytest" in said and str(tmp_path / "mine" / "test_led_droop.py") in said
    assert sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["led_droop.py", "test_led_droop.py"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_led_droop.py"]
    done = subprocess.run(command, cwd=tmp_path / "mine", capture_output=True, text=True)
    assert done.returncode == 0 and " passed" in done.stdout, done.stdout + done.stderr
    with effects_from(tmp_path / "mine" / "led_droop.py") as [effect]:
        assert effect.name == "led_droop" and effect.__name__ == "LedDroop"
    text = "".join(p.read_text(encoding="utf-8") for p in (tmp_path / "mine").glob("*.py"))
    assert TEMPLATE not in text and class_name(TEMPLATE) not in text


def test_its_test_fails_where_the_law_does_not_do_what_it_says(tmp_path: Path) -> None:
    effect, test = write_new_effect("led_droop", tmp_path)
    effect.write_text(effect.read_text().replace("1.0 - self.loss", "0.99 - self.loss"))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test], capture_output=True, text=True
    )
    assert done.returncode == 1 and "test_strength_zero_changes_no_bit" in done.stdout


def test_what_is_there_stays_unless_forced(tmp_path: Path, capsys) -> None:
    there = tmp_path / "test_led_droop.py"
    there.write_text("mine")
    assert run(["effects", "new", "led_droop", "--out", str(tmp_path)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert there.read_text() == "mine" and list(tmp_path.iterdir()) == [there]
    assert run(["effects", "new", "led_droop", "--out", str(tmp_path), "--force"]) == 0
    assert there.read_text() != "mine"


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_a_name_of_the_catalogue_is_a_class_and_back(name: str, tmp_path: Path) -> None:
    assert effect_name(class_name(name)) == name
    with pytest.raises(InputError, match=f"there is an effect {name} already"):
        write_new_effect(name, tmp_path)


@pytest.mark.parametrize(
    "name, said",
    [
        ("LedDroop", "lower-case words"),
        ("led-droop", "lower-case words"),
        ("2nd", "lower-case words"),
        ("../led", "plain file name"),
        ("con", "device on Windows"),
        ("a_b", "a class AB is called ab"),
        ("stage", "effects use Stage for something else"),
        ("effect", "effects use Effect for something else"),
    ],
)
def test_names_that_would_not_work_are_refused(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        write_new_effect(name, tmp_path)
    assert not list(tmp_path.iterdir())
