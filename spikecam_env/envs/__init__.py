"""Gymnasium environments.  Importing this package registers their ids; Gymnasium 1.x finds none by itself."""

from spikecam_env.envs.registration import register

register()
