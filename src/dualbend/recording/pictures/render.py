"""A run as a video or a picture: its trace, replayed through the model with its looks.

Nothing is simulated here; it draws without a screen where OpenGL can be had.
"""

from __future__ import annotations

import math
import warnings
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from dualbend.errors import InputError, writing
from dualbend.files import whole_file
from dualbend.recording.layers import layers_of
from dualbend.recording.pictures.offscreen import no_opengl
from dualbend.recording.pictures.video import SUFFIXES, largest_fps, refuse_missing, save_frames
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord

_ASPECT = 9 / 16
_LARGEST_PX, _SMALLEST_PX = 1920, 160
_INSET_SHARE, _INSET_ASPECT = 0.30, 0.78


@dataclass(frozen=True, kw_only=True)
class Look:
    """What is drawn, and how.

    ``camera``: a name of the model; None: ``bed`` in an assembly, else ``front``. ``fps``: frames
    a second of the video. ``speed``: simulated seconds in one of the video. ``width_px``: of the
    picture, 16 : 9. ``at_s``: the time of a still picture; None: the end. ``inset``: the close-up
    of a pin, in an assembly.
    """

    camera: str | None = None
    fps: float = 10.0
    speed: float = 4.0
    width_px: int = 480
    at_s: float | None = None
    inset: bool = True

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, even."""
        return 2 * (self.width_px // 2), 2 * round(self.width_px * _ASPECT / 2)


def check_look(look: Look, run: Run, path: Path) -> None:
    """Refuse before the run what cannot be drawn or written after it.

    Raises
    ------
    InputError
        A kind of file, a folder, a camera or a number that cannot be used, no OpenGL.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"--out {path}: {', '.join(SUFFIXES)} can be written")
    refuse_missing(path)
    if not path.parent.is_dir():
        raise InputError(f"--out {path}: {path.parent} is no folder")
    if look.at_s is not None and suffix != ".png":
        raise InputError(f"--at {look.at_s:g}: is the time of a .png, {path.name} is a video")
    for name, value, low, high in (
        ("fps", look.fps, 1, largest_fps(suffix)),
        ("speed", look.speed, 0.01, 100),
        ("width", look.width_px, _SMALLEST_PX, _LARGEST_PX),
    ):
        if not low <= value <= high:
            raise InputError(f"--{name} {value:g}: must be between {low:g} and {high:g}")
    cameras = [run.cell.model.camera(i).name for i in range(run.cell.model.ncam)]
    if look.camera is not None and look.camera not in cameras:
        raise InputError(f"--camera {look.camera}: the cameras are {', '.join(cameras)}")
    # A run is long; what cannot be drawn after it is refused before.
    open_renderer(run.cell.model, _SMALLEST_PX, _SMALLEST_PX).close()


def frame_rows(rows: int, look: Look, period_s: float) -> NDArray[np.intp]:
    """Return the rows that a video shows, from the first to the last, 1/fps apart in its time."""
    step = look.speed / look.fps / period_s
    count = 1 + math.ceil((rows - 1) / step)
    shown: NDArray[np.intp] = np.rint(step * np.arange(count)).astype(np.intp)
    return np.minimum(shown, rows - 1)


def write_video(result: RunRecord, path: Path, look: Look) -> int:
    """Draw the run into ``path`` (.gif, .png, .mp4) and return the number of frames.

    Raises
    ------
    InputError
        No OpenGL, a time beyond the run's end, a file that cannot be written.
    """
    rows, period_s = result.trace.rows, result.scenario.period_s
    if not rows:
        raise InputError(f"nothing to draw: {result.reason or 'the run has no cycles'}")
    still = path.suffix.lower() == ".png"
    shown = (
        np.array([_row_at(rows, look.at_s, period_s)])
        if still
        else frame_rows(rows, look, period_s)
    )
    with Stage(result, look) as stage, writing(path, "--out"), whole_file(path) as part:
        save_frames(map(stage.picture, shown.tolist()), part, look.fps)
    return len(shown)


def _row_at(rows: int, at_s: float | None, period_s: float) -> int:
    if at_s is None:
        return rows - 1
    row = math.floor(at_s / period_s + 1e-9)
    if not 0 <= row < rows:
        raise InputError(f"--at {at_s:g}: the run goes from 0 to {rows * period_s:.3f} s")
    return row


class Stage:
    """The model with its looks, the state of one row, and what draws them."""

    def __init__(self, result: RunRecord, look: Look) -> None:
        self._result, self._look = result, look
        self._data = mujoco.MjData(result.model)
        self._option = drawing_options()
        self._layers = layers_of(result)
        self._inset = look.inset and self._layers.close_up(result, 0) is not None
        self._camera = self._layers.camera if look.camera is None else look.camera
        self._open = ExitStack()

    def __enter__(self) -> Stage:
        """Open the renderers; InputError where there is no OpenGL."""
        width, height = self._look.size_px
        # Drawn twice as fine and averaged, where the frame buffer is large enough.
        fine = 2 if 2 * width <= _LARGEST_PX else 1
        inset = round(_INSET_SHARE * width)
        self._inset_px = (inset, round(_INSET_ASPECT * inset))
        try:
            self._main = self._renderer(fine * width, fine * height)
            if self._inset:
                self._close = self._renderer(*(fine * n for n in self._inset_px))
        except BaseException:
            self._open.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the renderers."""
        self._open.close()

    def _renderer(self, width: int, height: int) -> mujoco.Renderer:
        return self._open.enter_context(open_renderer(self._result.model, width, height))

    def picture(self, row: int) -> Image.Image:
        """Return the picture of one row, with its inset and what is happening."""
        model, data, result = self._result.model, self._data, self._result
        self._layers.pose_others(model, data, result, row)
        data.qpos[:] = result.trace.qpos[row]
        mujoco.mj_forward(model, data)
        picture = self._draw(self._main, self._camera, self._look.size_px)
        close_up = self._layers.close_up(result, row) if self._inset else None
        if close_up is not None:
            self._add_inset(picture, *close_up)
        self._caption(picture, row)
        return picture

    def _draw(
        self, renderer: mujoco.Renderer, camera: str | mujoco.MjvCamera, size: tuple[int, int]
    ) -> Image.Image:
        renderer.update_scene(self._data, camera=camera, scene_option=self._option)
        return Image.fromarray(renderer.render()).resize(size, Image.Resampling.BOX)

    def _add_inset(self, picture: Image.Image, camera: mujoco.MjvCamera, caption: str) -> None:
        """Paste the close-up of what just happens, with its caption."""
        close = self._draw(self._close, camera, self._inset_px)
        width, height = self._inset_px
        margin, border = picture.width // 60, max(1, picture.width // 320)
        left, top = picture.width - width - margin, picture.height - height - margin
        frame = (left - border, top - border, left + width + border - 1, top + height + border - 1)
        ImageDraw.Draw(picture).rectangle(frame, fill="white")
        picture.paste(close, (left, top))
        _write(picture, (left + margin // 2, top + height - margin // 2), caption, 0.022)

    def _caption(self, picture: Image.Image, row: int) -> None:
        result, margin = self._result, picture.width // 60
        words = result.phases[int(result.trace["phase"][row])]
        if row == result.trace.rows - 1:
            words = result.outcome.replace("_", " ")
        text = f"{words}   {result.trace['time'][row]:.1f} s"
        _write(picture, (margin, picture.height - margin), text, 0.03)


def drawing_options() -> mujoco.MjvOption:
    """Return what is drawn: neither what only touches nor sites."""
    option = mujoco.MjvOption()
    option.geomgroup[:] = (1, 1, 1, 0, 0, 0)
    option.sitegroup[:] = 0
    return option


def open_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Return what draws a model; InputError where there is no OpenGL."""
    try:
        with warnings.catch_warnings():
            # GLFW warns of what it then fails with.
            warnings.simplefilter("ignore")
            return mujoco.Renderer(model, height, width)
    except Exception as error:
        # Each back-end fails in its own way.
        raise no_opengl(error) from error


def _write(picture: Image.Image, corner: tuple[int, int], text: str, share: float) -> None:
    """Write dark text on a light plate, its lower left corner given; size over the width."""
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(max(9.0, share * picture.width))
    box = draw.textbbox(corner, text, font=font, anchor="lb")
    pad = max(2, picture.width // 160)
    draw.rectangle((box[0] - pad, box[1] - pad, box[2] + pad, box[3] + pad), fill=(245, 246, 248))
    draw.text(corner, text, font=font, anchor="lb", fill=(25, 28, 34))
