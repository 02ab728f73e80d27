"""`spikecam evaluate agents`: how well agents learn the tasks, by observation."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import unknown_name
from spikecam_env.numbers import WholeRange, Workers

if TYPE_CHECKING:
    from spikecam_env.agents.study import Result, StudyRun

FILM_FPS = 20
"""Steps a second of a film: 50 times slower than life where a step is a millisecond."""
MOST_SEEDS = 1000
MOST_EPISODES = 1000
"""As many as the test split has."""
MOST_POINTS = 100


@dataclass
class Agents:
    """Train agents on tasks and print the scores that they reach on test episodes (docs/agents.md).

    A score of 0 is that of doing nothing, of 1 the oracle's.  Runs that are in OUT already are not repeated.

    example:  spikecam evaluate agents --tasks Catch-v1 --observations tfp frame30 --seeds 2 --out study
    """

    out: Path
    """Folder for record.jsonl, a line a run; agents.txt, the table; curves.png; with --intervals, light.md and
    light.png, scores over light; with --levels, levels.md and levels.png, successes over levels; and every run's
    agent."""
    tasks: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID...")] = ("Track-v1", "Catch-v1", "Saccade-v1")
    """Ids, with or without `spikecam_env/`."""
    observations: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = (
        "tfp",
        "rate",
        "clean",
        "frame30",
        "frame1000",
        "classical",
    )
    """Observations: tfp, tfi, spikes, rate (denoised), dim_rate (the same, brighter), clean (no noise), root_tfp,
    root_rate and root_clean (on a root scale, for the dark), frame30, frame120,
    frame1000, root_frame30 ..., short_frame30 ... (exposed for 0.2 ms), events; see docs/observations.md; whole_spikes
    (of MuJoCo tasks, spikes of the whole step).
    Without training: classical (the task's classical player, sees tfp), classical-rate, classical-clean, and of Read
    and Return through every camera with grey pictures, classical-frame120 ...; shipped (the task's shipped agent,
    trained on tfp, sees it), shipped-rate, shipped-clean; oracle, nothing and random."""
    intervals: tuple[float, ...] = ()
    """Mean intervals [frames] at which each task is played, each a row, and learned.  Default: the task's own light."""
    trained: tuple[float, float] | None = None
    """Shortest and longest mean interval [frames] at which tasks are learned, one agent for all --intervals."""
    levels: tuple[int, ...] = ()
    """Levels at which each MuJoCo task is played, each a row, and learned.  Default: the middle one."""
    trained_levels: tuple[int, int] | None = None
    """Lowest and highest level at which tasks are learned, one agent for all --levels."""
    size: Size | None = None
    """Rows and columns of the camera.  Default: those of the id."""
    learners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = ("ppo",)
    """Learners, each with every observation: ppo (ours); sb3 (PPO of stable-baselines3, its defaults for pictures)."""
    imitate: bool = False
    """Our learner learns to act like the oracle, instead of from rewards (as of `train-agent`)."""
    seeds: Annotated[int, WholeRange(1, MOST_SEEDS)] = 5
    """Trainings of each task and observation, with different seeds."""
    first_seed: Annotated[int, WholeRange(0, 10**9)] = 0
    """The first of these seeds; the others follow it."""
    steps: tuple[int, ...] = ()
    """Training steps; several are trainings of their own, each a row.  Default: as many as the shipped agents had."""
    episodes: Annotated[int, WholeRange(1, MOST_EPISODES)] | None = None
    """Test episodes that make up a score.  Default: 100 of Catch, 50 of Saccade and of MuJoCo tasks, 10 of Track."""
    points: Annotated[int, WholeRange(0, MOST_POINTS)] = 12
    """Agents on the way that are played too, for curves.png; 0 saves their time."""
    jobs: Workers = 1
    """Trainings to run at the same time, each in a process of its own."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    """Train on a Ray cluster: its address, or `local` for one of --jobs workers here."""

    suite: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """A suite, v1, in place of tasks, observations, levels, learners, seeds, steps, episodes (docs/leaderboard.md)."""
    entry: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Write NAME.json too, an entry of the leaderboard (docs/leaderboard.md)."""
    films: bool = False
    """Write a film of the first test episode of each, TASK-NAME-SEED.mp4, of the first seed."""

    without_effect: ClassVar = (
        WithoutEffect(
            ("tasks", "observations", "levels", "trained_levels", "learners", "seeds", "steps", "episodes"),
            lambda c: c.suite is not None,
            "the suite {suite} says which",
        ),
        WithoutEffect(("imitate",), lambda c: "ppo" not in c.learners, "only ppo can imitate"),
        WithoutEffect(("jobs",), lambda c: c.ray not in (None, "local"), "the cluster {ray} has its own workers"),
    )

    def run(self) -> None:
        (self if self.suite is None else self._of_suite(self.suite))._run()

    def _of_suite(self, name: str) -> Agents:
        """The same with the options of a suite."""
        from spikecam_env.agents.suite import SUITES

        if name not in SUITES:
            raise unknown_name("suite", name, SUITES)
        return replace(self, suite=None, **vars(SUITES[name]))

    def _run(self) -> None:
        from spikecam_env.agents.report import draw_curves
        from spikecam_env.agents.study import cases, study

        tasks = [name.removeprefix("spikecam_env/") for name in self.tasks]
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        wanted = cases(
            tasks,
            self.observations,
            self.intervals,
            seeds,
            self.steps,
            self.episodes,
            trained=self.trained,
            levels=self.levels,
            trained_levels=self.trained_levels,
            shape=self.size,
            learners=self.learners,
            imitate=self.imitate,
        )
        results = study(wanted, self.out, points=self.points, jobs=self.jobs, ray=self.ray)
        written = ["record.jsonl", *self._tables(results)]
        if self.points:
            draw_curves(results, self.out / "curves.png")
            written.append("curves.png")
        if self.entry is not None:
            written.append(self._write_entry(results, self.entry))
        if self.films:
            self._film([result.case for result in results if result.case.seed == self.first_seed])
        print(f"wrote {', '.join(written)} in {self.out}")

    def _tables(self, results: list[Result]) -> list[str]:
        """Print and write the tables, with their pictures, and give the names of their files."""
        from spikecam_env.agents.over import LEVELS, LIGHT, draw_over, rows_over
        from spikecam_env.agents.study import summary
        from spikecam_env.cli.table import markdown, table
        from spikecam_env.whole import write_text_whole

        rows = summary(results)
        write_text_whole(self.out / "agents.txt", table(rows) + "\n")
        print(table(rows))
        written = ["agents.txt"]
        for name, over, values in (("light", LIGHT, self.intervals), ("levels", LEVELS, self.levels)):
            if values:
                rows = rows_over(results, over)
                write_text_whole(self.out / f"{name}.md", markdown(rows) + "\n")
                print("\n" + table(rows))
                draw_over(results, over, self.out / f"{name}.png")
                written += [f"{name}.md", f"{name}.png"]
        return written

    def _write_entry(self, results: list[Result], name: str) -> str:
        """Write the entry of the leaderboard, and give the name of its file."""
        from spikecam_env.agents.leaderboard import entry_of
        from spikecam_env.whole import write_text_whole

        own = entry_of(results, name, self._command())
        write_text_whole(self.out / f"{name}.json", own.model_dump_json(indent=1) + "\n")
        return f"{name}.json"

    def _command(self) -> str:
        """The command line that gives these options."""
        words = ["spikecam evaluate agents"]
        for option in fields(self):
            value = getattr(self, option.name)
            if option.default is MISSING or value != option.default:
                words.append("--" + option.name.replace("_", "-"))
                words += [str(one) for one in (value if isinstance(value, tuple) else [value]) if value is not True]
        return " ".join(words)

    def _film(self, played: list[StudyRun]) -> None:
        from spikecam_env.agents.report import pictures
        from spikecam_env.agents.study import environment_of, player_of
        from spikecam_env.cli.screen.film import write_film

        for case in played:
            env = environment_of(case, split="test", render_mode="rgb_array")
            try:
                write_film(
                    self.out / f"{case.folder}.mp4", pictures(player_of(case, self.out, env), env, seed=0), FILM_FPS
                )
            finally:
                env.close()
