"""`spikecam play`: films of policies, keys that steer, a window's pace; none of it needs a display."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest

from denoiser import OnlineDnSS
from spikecam_env.cli.live.episode_screen import EpisodeScreen
from spikecam_env.cli.live.episodes import Moment, environment, episode, most_seconds, pictures_due
from spikecam_env.cli.live.filming import watch
from spikecam_env.cli.live.keys import action_of, explained
from spikecam_env.cli.live.players import Player, player, steering
from spikecam_env.cli.screen.screen import AIM, TARGET
from spikecam_env.cli.screen.window import plain
from spikecam_env.envs.score import BASELINES, play
from tests.commands import film_in, spikecam


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: False)
    monkeypatch.chdir(tmp_path)


def test_without_a_display_the_oracle_is_filmed_and_the_path_printed(tmp_path: Path, capsys) -> None:
    """Catch of seed 0 at 40 times slower: 25 pictures for each millisecond of a fortieth, and a second of the end."""
    assert spikecam("play", "Catch-v1", "--denoise", "--score") == 0
    printed = capsys.readouterr().out
    assert "wrote Catch-v1.mp4: oracle at Catch-v1, 40 times slower than life" in printed
    assert "score 1.000" in printed
    cells = dict(zip(("seed", "steps", "time"), printed.splitlines()[-2].split(), strict=False))
    film = film_in(tmp_path / "Catch-v1.mp4")
    assert len(film) == round(float(cells["time"]) * 40 * 25 / 1000) + 25
    assert film[0].shape[1] > 2 * 320 and not np.array_equal(film[0], film[9])


def test_the_film_shows_what_the_score_is_of(capsys, tmp_path: Path) -> None:
    assert spikecam("play", "Catch-v1", "--policy", "random", "--episodes", 2, "--film", tmp_path / "a.mp4") == 0
    rows = capsys.readouterr().out.splitlines()[-2:]
    env = gymnasium.make("spikecam_env/Catch-v1", split="test", obs="tfp")
    for seed, row in enumerate(rows):
        played = play(env, BASELINES["random"], [seed])
        assert row.split()[:2] == [str(seed), f"{played.steps:.0f}"]
        assert row.split()[3] == f"{played.returns:.4g}"


def test_an_agent_acts_on_what_it_was_trained_on_and_begins_each_episode(monkeypatch, capsys, tmp_path: Path) -> None:
    begun, seen = [], []

    def act(observation: dict[str, Any]) -> np.ndarray:
        seen.append(observation)
        return np.zeros(1, np.float32)

    policy = SimpleNamespace(recipe=SimpleNamespace(actions=1))
    agent = SimpleNamespace(
        obs="tfi", sees={"obs": "tfi", "obs_state": True}, act=act, begin=lambda: begun.append(len(seen)), policy=policy
    )
    loaded: list[str] = []
    monkeypatch.setattr("spikecam_env.agents.agent.Agent.load", lambda name: loaded.append(name) or agent)
    line = ("play", "Catch-v1", "--policy", "mine.pt", "--episodes", 2, "--film", tmp_path / "a.mp4")
    assert spikecam(*line) == 0
    assert loaded == ["mine.pt"] and len(begun) == 2 and begun[1] > 3
    assert set(seen[0]) == {"picture", "gaze", "age"} and seen[0]["picture"].shape == (1, 64, 64)


@pytest.mark.parametrize(
    ("held", "action"),
    [
        ({"right"}, [1, 0, 0]),
        ({"a"}, [-1, 0, 0]),
        ({"up"}, [0, -1, 0]),
        ({"s", "d"}, [1, 1, 0]),
        ({"left", "right"}, [0, 0, 0]),
        ({"left", "a"}, [-1, 0, 0]),
        ({"e"}, [0, 0, 1]),
        ({"q"}, [0, 0, -1]),
        ({"1", "2", "escape"}, [0, 0, 1]),
    ],
)
def test_keys_that_are_held_make_an_action(held: set[str], action: list[float]) -> None:
    np.testing.assert_array_equal(action_of(held, 2, 1), action)


def test_a_number_key_says_its_answer() -> None:
    """In ReadSpin the second of four, in ReadDigit the digit itself."""
    np.testing.assert_array_equal(action_of({"2", "a", "e"}, 2, 5, 4), [-1, 0, 1, 0, 1, 0, 0])
    np.testing.assert_array_equal(action_of({"0"}, 2, 11, 10), [0, 0, 1, 1, *[0] * 9])
    np.testing.assert_array_equal(action_of({"5", "q"}, 2, 5, 4), np.zeros(7))
    assert "1 to 4: answer" in explained(2, 5, 4) and "0 to 9: answer" in explained(2, 11, 10)


def test_keys_have_no_meaning_where_the_action_has_no_such_number() -> None:
    np.testing.assert_array_equal(action_of({"up", "e", "right"}, 1, 0), [1])
    assert [plain(key) for key in ("shift+LEFT", "A", " ", None, "+")] == ["left", "a", "space", "", ""]


@pytest.mark.parametrize(("step_s", "slow"), [(1e-3, 40.0), (5e-4, 40.0), (1e-3, 100.0), (7e-4, 33.0)])
def test_the_pace_is_25_pictures_a_second(step_s: float, slow: float) -> None:
    total = sum(pictures_due(step * step_s, (step + 1) * step_s, slow) for step in range(500))
    assert abs(total - 500 * step_s * slow * 25) <= 1


class Acted:
    """A window whose user follows a script, by the number of the picture."""

    def __init__(self, script: dict[int, str], held: set[str]) -> None:
        self.script, self.held = script, held
        self.shown: list[float] = []
        self.waits, self.closed = 0, False
        self._keys: list[str] = []

    def show(self, picture: np.ndarray, seconds: float) -> None:
        self.shown.append(seconds)
        happens = self.script.get(len(self.shown), "")
        self.held.clear()
        if happens == "close":
            self.closed = True
        elif happens.startswith("hold "):
            self.held.add(happens.removeprefix("hold "))
        elif happens:
            self._keys.append(happens)

    def wait(self, seconds: float) -> None:
        self.waits += 1
        if self.waits == 3:
            self._keys.append("space")

    def taken(self) -> list[str]:
        keys, self._keys = self._keys, []
        return keys


def played(script: dict[int, str], seeds: Iterator[int] | range, name: str = "Track-v1") -> tuple[Acted, list, Any]:
    held: set[str] = set()
    user = Player(steering(held))
    env = environment(name, user, split="test")
    window = Acted(script, held)
    ended = watch(env, user, EpisodeScreen("task", "me"), seeds, 40.0, window)
    return window, ended, env


def test_a_person_steers_pauses_and_ends() -> None:
    window, ended, env = played({2: "hold right", 3: "hold right", 5: "space", 7: "escape"}, range(9))
    assert ended == [] and len(window.shown) == 7 and window.waits == 3
    assert env.unwrapped.gaze[0] > 0 and env.unwrapped.gaze[1] == 0
    assert window.shown[1] == pytest.approx(0.04)


def test_the_next_episode_is_begun_by_n_and_a_closed_window_ends() -> None:
    window, ended, env = played({3: "n", 6: "close"}, range(9))
    assert ended == [] and len(window.shown) == 6 and env.unwrapped.standing.step == 2


def test_an_episode_that_ends_is_counted_and_the_next_begins() -> None:
    window, ended, _ = played({}, range(2), "Catch-v1")
    assert [last.seed for last in ended] == [0, 1] and all(last.over for last in ended)
    assert sum(window.shown) == pytest.approx(sum(40 * last.time_s + 1.0 for last in ended), abs=0.2)


def test_a_moment_is_of_the_step_it_says() -> None:
    env = environment("Catch-v1", player("nothing", "Catch-v1"), split="test")
    moments = list(episode(env, player("nothing", "Track-v1"), 0))
    assert [m.step for m in moments] == list(range(len(moments)))
    assert [m.frame for m in moments] == [20 * (m.step + 1) for m in moments]
    assert moments[-1].over and not any(m.over for m in moments[:-1])
    assert moments[-1].total == pytest.approx(sum(m.reward for m in moments))
    assert moments[-1].time_s <= most_seconds(env) + 20 / 40_000


def test_pictures_are_the_share_of_the_last_frames_and_the_newest_plane() -> None:
    rng = np.random.default_rng(0)
    blocks = (rng.random((6, 20, 16, 16)) < 0.3).astype(np.uint8)
    screen = EpisodeScreen("task", "me", denoise=True)
    for step, block in enumerate(blocks):
        screen.see(Moment(0, step, 20 * (step + 1), 0.0, block, 0.0, 0.0, {}, False))
        assert (screen.denoised is None) == (step == 0)
    np.testing.assert_allclose(screen.noisy, blocks[-2:].reshape(40, 16, 16).mean(axis=0), atol=1e-6)
    planes = OnlineDnSS.pretrained("best", output="rate").push(blocks.reshape(120, 16, 16))
    np.testing.assert_array_equal(screen.denoised, planes[-1])
    screen.see(Moment(1, 0, 20, 0.0, blocks[0], 0.0, 0.0, {}, False))
    assert screen.denoised is None
    np.testing.assert_allclose(screen.noisy, blocks[0].mean(axis=0), atol=1e-6)


def test_the_target_is_marked_where_it_is_and_only_where_asked() -> None:
    env = environment("Track-v1", player("nothing", "Track-v1"), split="test")
    moment = next(episode(env, player("nothing", "Track-v1"), 0))

    def places(colour: tuple[int, int, int], **options: Any) -> np.ndarray:
        screen = EpisodeScreen("Track-v1", "nothing", **options)
        screen.see(moment)
        return np.argwhere((screen.picture(moment) == colour).all(axis=-1))

    assert len(places(TARGET)) == 0
    ring = places(TARGET, show_target=True)
    x, y = moment.info["target"]
    np.testing.assert_allclose(ring.mean(axis=0), [10 + 5 * (y + 0.5), 10 + 5 * (x + 0.5)], atol=1.0)
    np.testing.assert_allclose(places(AIM).mean(axis=0), [10 + 160, 10 + 160], atol=1.0)
