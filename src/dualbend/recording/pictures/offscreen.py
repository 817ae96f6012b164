"""OpenGL without a screen: which back-end MuJoCo draws with is settled when it is imported."""

from __future__ import annotations

import importlib
import os
import sys

from dualbend.errors import InputError

HELP = (
    "set MUJOCO_GL=egl (Debian packages libegl1 and libgl1-mesa-dri) "
    "or MUJOCO_GL=osmesa (libosmesa6)"
)


def prepare() -> None:
    """Choose EGL on Linux without a screen, unless ``MUJOCO_GL`` says otherwise; import MuJoCo.

    To be called before anything else imports MuJoCo; InputError where it cannot be loaded.
    """
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")
    try:
        importlib.import_module("mujoco")
    except Exception as error:
        # Each back-end fails in its own way where its library is not there.
        raise no_opengl(error) from error


def no_opengl(error: Exception) -> InputError:
    """Return the message for a picture that cannot be drawn here."""
    name = os.environ.get("MUJOCO_GL", "")
    where = f" by MUJOCO_GL={name}" if name else ""
    return InputError(f"no OpenGL{where} to draw with ({error}): {HELP}")
