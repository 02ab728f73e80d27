"""The score of a policy on test episodes, and its interval.

    score = (performance - nothing's) / (oracle's - nothing's)

The interval covers the score of all episodes of the split in 95 of 100 evaluations.

- If every performance is 0 or 1 (Catch, Saccade), it is Wilson's interval of their mean, scaled as the score is.
- Otherwise it is a paired bootstrap.  Episodes are drawn with replacement, each with the performances of the policy, of
  nothing and of the oracle, and the score is computed anew.

Sources: Wilson, JASA 22 (1927); Efron and Tibshirani, "An Introduction to the Bootstrap" (1993), chapter 13.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binomtest

from spikecam_env.envs.score import score
from spikecam_env.types import Floats

CONFIDENCE = 0.95
"""Share of evaluations whose interval covers the score."""
RESAMPLES = 2000
"""Draws of the bootstrap: its ends are then within a tenth of the interval's half width of those of infinitely many."""


@dataclass(frozen=True)
class Evaluation:
    """Score of a policy at a task, with its interval.

    Example:
        >>> print(Evaluation.of("Catch-v1", [1.0, 0.0, 1.0, 1.0], [0.0] * 4, [1.0] * 4, success=0.75, returns=9.0))
        Catch-v1, 4 episodes
          score        0.750   95 % interval 0.301 to 0.954 (Wilson)
          performance  0.750   nothing 0.000, oracle 1.000
          success      0.750
          return       9.00
    """

    task: str
    """Id, without `spikecam_env/`."""
    score: float
    """0 is doing nothing, 1 the oracle; NaN if the oracle does no better than nothing."""
    low: float
    """Lower end of the interval; NaN for a single episode."""
    high: float
    """Upper end of the interval; NaN for a single episode."""
    method: str
    """How the interval was computed: "Wilson" or "bootstrap"."""
    performance: float
    """Mean of `info["performance"]` at the episodes' ends."""
    nothing: float
    """The same of doing nothing, on the same episodes."""
    oracle: float
    """The same of the oracle, on the same episodes."""
    success: float
    """Share of episodes that end in success."""
    returns: float
    """Mean of the undiscounted sum of rewards."""
    performances: tuple[float, ...] = field(repr=False)
    """Performance in each episode."""
    camera_bits_s: float = float("nan")
    """What the camera sent [bits/s]; NaN where it is not known."""

    @classmethod
    def of(
        cls,
        task: str,
        performances: Sequence[float],
        nothing: Sequence[float],
        oracle: Sequence[float],
        *,
        success: float,
        returns: float,
        camera_bits_s: float = float("nan"),
    ) -> Evaluation:
        """The evaluation of episodes, from the performances of policy, nothing and oracle in each."""
        reached, still, best = (np.asarray(one, float) for one in (performances, nothing, oracle))
        mean, low_end, high_end = float(reached.mean()), float(still.mean()), float(best.mean())
        method = "Wilson" if np.isin(reached, (0.0, 1.0)).all() else "bootstrap"
        interval = _wilson if method == "Wilson" else _bootstrap
        low, high = interval(reached, still, best)
        of_policy, each = score(mean, low_end, high_end), tuple(reached.tolist())
        return cls(task, of_policy, low, high, method, mean, low_end, high_end, success, returns, each, camera_bits_s)

    def __str__(self) -> str:
        count = len(self.performances)
        percent = f"{100 * CONFIDENCE:g} % interval {self.low:.3f} to {self.high:.3f} ({self.method})"
        return "\n".join(
            [
                f"{self.task}, {count} episode{'s' * (count > 1)}",
                f"  score        {self.score:.3f}   {percent}",
                f"  performance  {self.performance:.3f}   nothing {self.nothing:.3f}, oracle {self.oracle:.3f}",
                f"  success      {self.success:.3f}",
                f"  return       {self.returns:.2f}",
                *([] if np.isnan(self.camera_bits_s) else [f"  camera       {self.camera_bits_s / 1e6:.3g} Mbit/s"]),
            ]
        )


def _wilson(reached: Floats, nothing: Floats, oracle: Floats) -> tuple[float, float]:
    """The interval if every performance is 0 or 1."""
    ends = binomtest(int(reached.sum()), len(reached)).proportion_ci(CONFIDENCE, method="wilson")
    low, high = (score(float(end), float(nothing.mean()), float(oracle.mean())) for end in ends)
    return low, high


def _bootstrap(reached: Floats, nothing: Floats, oracle: Floats) -> tuple[float, float]:
    """The interval of other performances; NaN for a single episode."""
    count = len(reached)
    if count < 2:
        return float("nan"), float("nan")
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
    mean, still, best = (each[drawn].mean(axis=1) for each in (reached, nothing, oracle))
    defined = best > still
    if not defined.any():
        return float("nan"), float("nan")
    scores = (mean - still)[defined] / (best - still)[defined]
    low, high = np.quantile(scores, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]).tolist()
    return low, high
