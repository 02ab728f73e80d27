"""The spike camera you can step: sensor, streams, environments.  See `docs/architecture.md`.

Importing it registers the environments with Gymnasium, which looks for none by itself since 1.0.
"""

from spikecam_env import envs

__version__ = "0.1.0"

__all__ = ["__version__", "envs"]
