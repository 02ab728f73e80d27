"""Gymnasium environments.  Importing this package registers their ids."""

from spikecam_env.envs.registration import register

register()
