"""Pictures put into a file: one as PNG, a video as GIF or, with PyAV, as MP4."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

from dualbend.errors import InputError

SUFFIXES = (".gif", ".png", ".mp4")

_LAST_FRAME_S = 1.5
"""How long a GIF stands still on its last frame before it begins anew."""

_COLOURS, _PALETTE_FRAMES = 255, 12

_QUALITY = {"crf": "20"}
"""Constant quality of H.264: 18 is hardly told from the original, 23 is the encoder's own."""


def largest_fps(suffix: str) -> float:
    """Return how many frames a second a kind of file can have: a GIF counts in hundredths."""
    return 120.0 if suffix == ".mp4" else 50.0


def refuse_missing(path: Path) -> None:
    """Raise InputError where what writes this kind of file is not installed."""
    if path.suffix.lower() == ".mp4" and find_spec("av") is None:
        raise InputError(
            f"--out {path}: an .mp4 is written by PyAV, which is not installed: "
            "pip install 'dualbend[video]', or give a .gif"
        )


def save_frames(frames: Iterable[Image.Image], path: Path, fps: float) -> None:
    """Write pictures of one size, a single one where it is a .png; the ending tells the kind.

    Raises OSError where the file cannot be written.
    """
    match path.suffix.lower():
        case ".mp4":
            _save_mp4(frames, path, fps)
        case ".gif":
            _save_gif(list(frames), path, fps)
        case _:
            next(iter(frames)).save(path)


def frame_times_ms(count: int, fps: float) -> list[int]:
    """Return how long each frame is shown [ms], whole hundredths of a second, right on average."""
    ends = 10 * np.rint(100.0 * np.arange(count + 1) / fps).astype(int)
    times: list[int] = np.diff(ends).tolist()
    return [*times[:-1], times[-1] + round(1e3 * _LAST_FRAME_S)]


def _save_gif(frames: list[Image.Image], path: Path, fps: float) -> None:
    """Write a GIF with one palette: what stands still between two frames then costs nothing."""
    sample = frames[:: max(1, len(frames) // _PALETTE_FRAMES)]
    width, height = frames[0].size
    sheet = Image.new("RGB", (width, height * len(sample)))
    for i, frame in enumerate(sample):
        sheet.paste(frame, (0, i * height))
    # By octree: the median cut gives all colours to the floor and none to the brass pins.
    palette = sheet.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE)
    none = Image.Dither.NONE
    first, *others = (frame.quantize(palette=palette, dither=none) for frame in frames)
    times_ms = frame_times_ms(len(frames), fps)
    first.save(path, save_all=True, append_images=others, duration=times_ms, loop=0, disposal=1)


def _save_mp4(frames: Iterable[Image.Image], path: Path, fps: float) -> None:
    """Write H.264 in an MP4, frame n at n/fps; one at a time, so that none waits in memory.

    Players and browsers read 4:2:0, and begin before the file is there if its index comes first.
    """
    import av  # noqa: PLC0415 - an extra

    rate = Fraction(fps).limit_denominator(1000)
    with av.open(path, "w", format="mp4", options={"movflags": "+faststart"}) as video:
        stream = video.add_stream("libx264", rate=rate, options=_QUALITY)
        stream.pix_fmt = "yuv420p"
        for n, picture in enumerate(frames):
            if not n:
                stream.width, stream.height = picture.size
            video.mux(stream.encode(av.VideoFrame.from_image(picture)))
        video.mux(stream.encode())
