"""The spike camera you can step: sensor, streams, environments.  See `docs/architecture.md`.

Importing it registers the environments with Gymnasium, which looks for none by itself since 1.0.
"""

from spikecam_env import stopping

if stopping.is_command():  # before the imports below, which take a while in which the command may be stopped
    stopping.watch()

from spikecam_env import envs
from spikecam_env.envs.registration import OBSERVATIONS_ABOVE
from spikecam_env.siblings import check_siblings
from spikecam_env.version import __version__

check_siblings()

OBSERVATIONS_ABOVE |= {
    "rate": ("denoiser.observation:Rate", {}),
    "dim_rate": ("denoiser.observation:Rate", {"white": 0.1}),
    "root_rate": ("denoiser.observation:Rate", {"gamma": 0.5}),
}

__all__ = ["__version__", "envs"]
