"""The spike camera you can step: sensor, streams, environments.  See `docs/architecture.md`.

Importing it registers the environments with Gymnasium, which looks for none by itself since 1.0.
"""

from spikecam_env import stopping

if stopping.is_command():  # before the imports below, which take a while in which the command may be stopped
    stopping.watch()

from spikecam_env import envs
from spikecam_env.siblings import check_siblings
from spikecam_env.version import __version__

check_siblings()

__all__ = ["__version__", "envs"]
