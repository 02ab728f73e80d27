"""The spike camera you can step: sensor, streams, environments.  See `docs/architecture.md`.

Importing it registers the environments with Gymnasium, which looks for none by itself since 1.0.
"""

from spikecam_env import envs
from spikecam_env.version import __version__

__all__ = ["__version__", "envs"]
