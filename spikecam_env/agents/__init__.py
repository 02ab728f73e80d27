"""Agents that see through a spike camera: a learner, its policies with shipped weights, and a classical tracker.

- policy: the network, from pictures and gaze to the action.
- ppo: the learner.
- agent: a trained policy that acts, in one environment or many; the shipped ones by the id of their task.
- tracker: no learning, the target's centroid and a motor law.
- study: scores of agents by task, observation and light.
- evaluation: the score of any policy, in one call: `evaluate`.
"""

from spikecam_env.agents.evaluation import evaluate
from spikecam_env.envs.evaluation import Evaluation

__all__ = ["Evaluation", "evaluate"]
