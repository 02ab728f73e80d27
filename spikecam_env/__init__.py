"""The spike camera you can step: sensor, streams, environments.  See `docs/architecture.md`."""

__version__ = "0.1.0"
