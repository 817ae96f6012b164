"""What is drawn of a run: the right moments at the right pace, the holes where they are."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.recording.pictures import offscreen, video
from dualbend.recording.pictures.render import Look, check_look, frame_rows, write_video
from dualbend.recording.pictures.video import frame_times_ms, save_frames
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import without_looks
from dualbend.scene.sheet.strips import strip_body
from dualbend.task.assembly.program.motions import PHASES
from support.made_up_book import make_book
from support.strip import STRIP8

NO_OPENGL = 77

DRAWING = f"""
import sys
from dualbend.recording.pictures import offscreen
from dualbend.errors import InputError
try:
    offscreen.prepare()
    from pathlib import Path
    from support.made_up_book import make_book
    from dualbend.recording.pictures.render import Look, Stage, write_video
    folder, (_, result) = Path(sys.argv[1]), make_book()
    write_video(result, folder / "run.gif", Look(width_px=160, speed=10.0))
    write_video(result, folder / "at.png", Look(width_px=160, at_s=0.5, camera="front"))
    row = result.trace["phase"].tolist().index({PHASES.index("bend")})
    with Stage(result, Look(width_px=960, inset=False)) as stage:
        stage.picture(row).save(folder / "bent.png")
except InputError as error:
    print(error, file=sys.stderr)
    sys.exit({NO_OPENGL})
"""
"""In a process of its own: what draws is settled when MuJoCo is first imported."""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn")
    paths = [str(Path(__file__).parent), *sys.path]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    done = subprocess.run(
        [sys.executable, "-c", DRAWING, str(folder)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == NO_OPENGL:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def bending() -> Run:
    return make_run(load_scenario(STRIP8, ("path.end_rad=0.4",)))


@pytest.mark.parametrize(("fps", "speed"), [(10.0, 4.0), (25.0, 1.0), (50.0, 0.5), (3.0, 7.0)])
@pytest.mark.parametrize("rows", [1, 2, 97, 1392])
def test_a_video_is_as_long_as_the_run_over_its_speed(rows: int, fps: float, speed: float) -> None:
    shown = frame_rows(rows, Look(fps=fps, speed=speed), COMMAND_PERIOD_S)
    assert shown[0] == 0
    assert shown[-1] == rows - 1  # the outcome is seen
    assert (np.diff(shown) >= 0).all()
    # Discretisation: a frame shows the nearest row, half a cycle off at most; the last one is
    # cut short.
    ideal = np.minimum(np.arange(len(shown)) * speed / fps / 0.028, rows - 1)
    assert np.abs(shown - ideal).max() <= 0.5 + 1e-6
    times = frame_times_ms(len(shown), fps)
    assert all(time % 10 == 0 for time in times)
    pace = np.cumsum(times[:-1]) - 1e3 / fps * np.arange(1, len(times))
    assert np.abs(pace).max(initial=0.0) <= 5.0 + 1e-9  # half a hundredth, and it does not grow


@pytest.mark.parametrize(
    ("look", "name", "message"),
    [
        (Look(), "run.avi", r"\.gif, \.png, \.mp4 can be written"),
        (Look(), "missing/run.gif", "is no folder"),
        (Look(camera="side"), "run.gif", "--camera side: the cameras are front"),
        (Look(fps=0.0), "run.gif", "--fps 0: must be between 1 and 50"),
        (Look(fps=60.0), "run.gif", "--fps 60: must be between 1 and 50"),
        (Look(fps=float("nan")), "run.gif", "--fps nan: must be between"),
        (Look(speed=-1.0), "run.gif", "--speed -1"),
        (Look(width_px=4000), "run.gif", "--width 4000: must be between 160 and 1920"),
        (Look(at_s=1.0), "run.gif", "--at 1: is the time of a .png"),
    ],
)
def test_what_cannot_be_drawn_is_refused_before_the_run(
    bending: Run, tmp_path: Path, look: Look, name: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        check_look(look, bending, tmp_path / name)


def test_an_mp4_without_what_writes_it_is_refused_with_the_extra_to_install(
    bending: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"run\.mp4: .*pip install 'dualbend\[video\]', or give a"):
        check_look(Look(), bending, tmp_path / "run.mp4")


@pytest.mark.parametrize("fps", [1.0, 3.7, 10.0, 29.97, 120.0])
@pytest.mark.parametrize("count", [1, 2, 25])
def test_an_mp4_has_every_frame_at_its_time(fps: float, count: int, tmp_path: Path) -> None:
    """Read back: times exact but for the fraction that stands for fps, colours but for 4:2:0."""
    av = pytest.importorskip("av")
    ramp = (20 + 200 * np.arange(count) / count).astype(int).tolist()
    pictures = [Image.new("RGB", (160, 90), (level, 255 - level, 60)) for level in ramp]
    save_frames(iter(pictures), tmp_path / "run.mp4", fps)
    with av.open(tmp_path / "run.mp4") as found:
        stream = found.streams.video[0]
        assert (stream.codec.name, stream.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == (160, 90)
        frames = list(found.decode(stream))
        duration_s = float(stream.duration * stream.time_base)
    assert len(frames) == count
    # 1/1000 of the rate's denominator, or a tick of the file's clock.
    assert duration_s == pytest.approx(count / fps, rel=1e-3)
    assert [frame.time for frame in frames] == pytest.approx(
        (np.arange(count) / fps).tolist(), abs=1e-4, rel=1e-3
    )
    for frame, level in zip(frames, ramp, strict=True):
        seen = frame.to_ndarray(format="rgb24").astype(float).mean(axis=(0, 1))
        assert np.abs(seen - (level, 255 - level, 60)).max() < 6.0


def test_a_run_becomes_an_mp4_as_long_as_itself_over_its_speed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a renderer that needs no OpenGL, so that this is tried everywhere."""
    av = pytest.importorskip("av")

    class Renderer:
        def __init__(self, _: object, height: int, width: int) -> None:
            self.shape = height, width, 3

        def update_scene(self, *_: object, **__: object) -> None:
            pass

        def render(self) -> np.ndarray:
            return np.full(self.shape, 128, dtype=np.uint8)

        def __enter__(self) -> Renderer:
            return self

        def __exit__(self, *_: object) -> None:
            pass

    monkeypatch.setattr(mujoco, "Renderer", Renderer)
    _, result = make_book()
    look = Look(width_px=161, fps=12.5, speed=10.0)
    count = write_video(result, tmp_path / "run.mp4", look)
    assert count == len(frame_rows(result.trace.rows, look, result.scenario.period_s))
    with av.open(tmp_path / "run.mp4") as found:
        stream = found.streams.video[0]
        assert (stream.width, stream.height) == (160, 90)  # 4:2:0 needs even numbers
        assert sum(1 for _ in found.decode(stream)) == count
        assert float(stream.duration * stream.time_base) == pytest.approx(count / 12.5, rel=1e-4)
    # No frame beyond the run's end, and none missing at it: one frame's time is allowed.
    run_s = result.scenario.period_s * result.trace.rows
    assert count / 12.5 == pytest.approx(run_s / 10.0, abs=2 / 12.5)


def test_an_mp4_that_cannot_be_written_is_the_systems_error(tmp_path: Path) -> None:
    pytest.importorskip("av")
    with pytest.raises(OSError, match="No such file"):
        save_frames(iter([Image.new("RGB", (160, 90))]), tmp_path / "none" / "run.mp4", 10.0)


def test_a_time_beyond_the_end_is_refused(tmp_path: Path) -> None:
    _, result = make_book()
    end_s = 0.028 * result.trace.rows
    for at_s in (-0.1, end_s):
        with pytest.raises(InputError, match=f"the run goes from 0 to {end_s:.3f} s"):
            write_video(result, tmp_path / "at.png", Look(at_s=at_s))


def test_no_opengl_is_told_before_the_run_with_what_helps(
    bending: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def renderer(*_: object) -> None:
        raise RuntimeError("no display")

    monkeypatch.setattr(mujoco, "Renderer", renderer)
    with pytest.raises(InputError, match=r"no display.*MUJOCO_GL=egl .*MUJOCO_GL=osmesa"):
        check_look(Look(), bending, tmp_path / "run.gif")


def test_a_back_end_that_does_not_load_is_bad_input() -> None:
    code = "from dualbend.recording.pictures import offscreen; offscreen.prepare()"
    environment = os.environ | {
        "MUJOCO_GL": "nonsense",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert "InputError: no OpenGL by MUJOCO_GL=nonsense" in done.stderr


@pytest.mark.parametrize(
    ("display", "given", "chosen"),
    [(None, None, "egl"), (":0", None, None), (None, "glfw", "glfw")],
)
def test_without_a_screen_egl_is_chosen(
    monkeypatch: pytest.MonkeyPatch, display: str | None, given: str | None, chosen: str | None
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name, value in (("DISPLAY", display), ("MUJOCO_GL", given)):
        # Set first: what is changed below is then undone too.
        monkeypatch.setenv(name, value or "")
        if value is None:
            monkeypatch.delenv(name)
    offscreen.prepare()
    assert os.environ.get("MUJOCO_GL") == chosen


def test_looks_are_not_simulated() -> None:
    run = make_run(load_scenario("pwb-stack"))
    bare = run.cell.spec.copy()
    for geom in list(bare.geoms):
        laid = geom.parent.name.startswith("laid_")  # bodies that never move: weight is nothing
        if geom.group == 2 and not geom.contype and not geom.conaffinity and not laid:
            bare.delete(geom)
    names = {run.cell.model.geom(i).name for i in range(run.cell.model.ngeom)}
    assert "hole_outer_left_disc" in names
    expected, found = bare.compile(), without_looks(run.cell.spec).compile()
    # Exact: what is only looked at weighs nothing and is discarded.
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))
    touching = [(m.geom_contype | m.geom_conaffinity) != 0 for m in (found, expected)]
    for field in ("geom_size", "geom_pos", "geom_quat", "geom_friction", "geom_bodyid"):
        ours, theirs = (
            getattr(m, field)[t] for m, t in zip((found, expected), touching, strict=True)
        )
        np.testing.assert_array_equal(ours, theirs)
    assert "hole_outer_left_disc" not in {found.geom(i).name for i in range(found.ngeom)}


@pytest.mark.slow
def test_the_video_has_all_frames_at_their_pace(drawn: Path) -> None:
    _, result = make_book()
    look = Look(width_px=160, speed=10.0)
    shown = frame_rows(result.trace.rows, look, result.scenario.period_s)
    with Image.open(drawn / "run.gif") as video:
        assert video.size == (160, 90)
        assert video.n_frames == len(shown)
        assert video.info["loop"] == 0
        times = []
        for i in range(video.n_frames):
            video.seek(i)
            times.append(video.info["duration"])
    assert times == frame_times_ms(len(shown), look.fps)
    with Image.open(drawn / "at.png") as still:
        assert still.size == (160, 90)
        assert np.ptp(np.asarray(still)) > 100  # a scene, no empty frame


@pytest.mark.slow
def test_holes_are_dark_where_the_camera_sees_them(drawn: Path) -> None:
    _, result = make_book()
    model, data = result.model, mujoco.MjData(result.model)
    row = result.trace["phase"].tolist().index(PHASES.index("bend"))
    data.qpos[:] = result.trace.qpos[row]
    mujoco.mj_forward(model, data)
    with Image.open(drawn / "bent.png") as picture:
        pixels = np.asarray(picture).astype(int)
    strip = data.body(strip_body(8)).xmat.reshape(3, 3)
    for hole in ("middle_left", "middle_right"):
        centre = data.site(f"hole_{hole}").xpos
        dark = pixels[_pixel(model, data, centre, pixels.shape)]
        assert dark.max() < 90, hole  # golden: 5 to 40 of 255
        beside = pixels[_pixel(model, data, centre + 0.012 * strip[:, 1], pixels.shape)]
        assert beside[2] - beside[0] > 60, hole  # golden: the sheet's blue, 100 above its red


def _pixel(
    model: mujoco.MjModel, data: mujoco.MjData, point: np.ndarray, shape: tuple[int, ...]
) -> tuple[int, int]:
    """Return row and column of a point in the picture of the camera ``bed`` (pinhole)."""
    camera = model.camera("bed").id
    x, y, z = data.cam_xmat[camera].reshape(3, 3).T @ (point - data.cam_xpos[camera])
    focal = 0.5 * shape[0] / np.tan(np.radians(model.cam_fovy[camera]) / 2)
    return round(shape[0] / 2 + focal * y / z), round(shape[1] / 2 - focal * x / z)
