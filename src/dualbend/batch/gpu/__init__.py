"""Many worlds on a GPU, by MuJoCo Warp: an extra."""

from dualbend.errors import InputError

EXTRA = "many worlds on a device need MuJoCo Warp: pip install 'dualbend[gpu]'"

try:
    import warp

    # It tells of every module that it loads.
    warp.config.log_level = warp.LOG_WARNING
    import mujoco_warp as _  # noqa: F401
except ImportError as error:
    raise InputError(EXTRA) from error
