"""`spikecam evaluate agents`: how well agents learn the tasks, by observation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from spikecam_env.cli.options import Size
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
    light.png, scores over light; and every run's agent."""
    tasks: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID...")] = ("Track-v1", "Catch-v1", "Saccade-v1")
    """Ids, with or without `spikecam_env/`."""
    observations: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = (
        "tfp",
        "rate",
        "clean",
        "frame30",
        "frame1000",
        "tracker",
    )
    """Observations: tfp, tfi, spikes, rate (denoised), dim_rate (the same, brighter), clean (no noise), root_tfp,
    root_rate and root_clean (on a root scale, for the dark), frame30, frame120, frame1000, root_frame30 ...  Without
    training: tracker (classical, sees tfp), tracker-rate, tracker-clean; shipped (the task's shipped agent, trained on
    tfp, sees it), shipped-rate, shipped-clean."""
    intervals: tuple[float, ...] = ()
    """Mean intervals [frames] at which each task is played, each a row, and learned.  Default: the task's own light."""
    trained: tuple[float, float] | None = None
    """Shortest and longest mean interval [frames] at which tasks are learned, one agent for all --intervals."""
    size: Size | None = None
    """Rows and columns of the camera.  Default: those of the id."""
    imitate: bool = False
    """Learn to act like the oracle, instead of from rewards (as of `train-agent`)."""
    seeds: Annotated[int, WholeRange(1, MOST_SEEDS)] = 5
    """Trainings of each task and observation, with different seeds."""
    first_seed: Annotated[int, WholeRange(0, 10**9)] = 0
    """The first of these seeds; the others follow it."""
    steps: tuple[int, ...] = ()
    """Training steps; several are trainings of their own, each a row.  Default: as many as the shipped agents had."""
    episodes: Annotated[int, WholeRange(1, MOST_EPISODES)] | None = None
    """Test episodes that make up a score.  Default: 100 of Catch, 50 of Saccade, 10 of Track."""
    points: Annotated[int, WholeRange(0, MOST_POINTS)] = 12
    """Agents on the way that are played too, for curves.png; 0 saves their time."""
    jobs: Workers = 1
    """Trainings to run at the same time, each in a process of its own."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    """Train on a Ray cluster: its address, or `local` for one of --jobs workers here."""

    films: bool = False
    """Write a film of the first test episode of each, TASK-NAME-SEED.mp4, of the first seed."""

    def run(self) -> None:
        from spikecam_env.agents.over_light import draw_over_light
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
            shape=self.size,
            imitate=self.imitate,
        )
        results = study(wanted, self.out, points=self.points, jobs=self.jobs, ray=self.ray)
        written = ["record.jsonl", *self._tables(results)]
        if self.points:
            draw_curves(results, self.out / "curves.png")
            written.append("curves.png")
        if self.intervals:
            draw_over_light(results, self.out / "light.png")
            written.append("light.png")
        if self.films:
            self._film([result.case for result in results if result.case.seed == self.first_seed])
        print(f"wrote {', '.join(written)} in {self.out}")

    def _tables(self, results: list[Result]) -> list[str]:
        """Print and write the tables, and give the names of their files."""
        from spikecam_env.agents.over_light import light_rows
        from spikecam_env.agents.study import summary
        from spikecam_env.cli.table import markdown, table
        from spikecam_env.whole import write_text_whole

        rows = summary(results)
        write_text_whole(self.out / "agents.txt", table(rows) + "\n")
        print(table(rows))
        if not self.intervals:
            return ["agents.txt"]
        over_light = light_rows(results)
        write_text_whole(self.out / "light.md", markdown(over_light) + "\n")
        print("\n" + table(over_light))
        return ["agents.txt", "light.md"]

    def _film(self, played: list[StudyRun]) -> None:
        from spikecam_env.agents.report import pictures
        from spikecam_env.agents.study import actor_of
        from spikecam_env.cli.screen.film import write_film

        for case in played:
            env = case.played.make(split="test", render_mode="rgb_array")
            try:
                write_film(
                    self.out / f"{case.folder}.mp4", pictures(actor_of(case, self.out, env), env, seed=0), FILM_FPS
                )
            finally:
                env.close()
