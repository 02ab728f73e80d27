"""Light from MuJoCo: `pip install 'spikecam-env[mujoco]'`.  See docs/howto/mujoco.md."""

from scenes.mujoco.cameras import camera_of
from scenes.mujoco.importing import import_mujoco
from scenes.mujoco.light import MujocoLight
from scenes.mujoco.pictures import MujocoPictures

__all__ = ["MujocoLight", "MujocoPictures", "camera_of", "import_mujoco"]
