"""What an assembly's recording shows beside a bending's: bed, pins, holes, laid sheets, contact."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.recording.log import FRAME_CYCLES, Colour, RecordingLog
from dualbend.run.loop import RunResult
from dualbend.run.trace import Trace
from dualbend.scene.bed.config import HOLES
from dualbend.task.assembly.laid_sheets import supply_rows
from dualbend.task.assembly.motions import PHASES
from dualbend.types import Vector

PHASE_COLOURS = {
    "approach": 0x607D8BFF,
    "grasp": 0x8D6E63FF,
    "lift": 0x78909CFF,
    "carry": 0x607D8BFF,
    "bend": 0x42A5F5FF,
    "lower": 0xF9A825FF,
    "seat middle": 0x26A69AFF,
    "unfold": 0x42A5F5FF,
    "lower outer": 0xF9A825FF,
    "seat outer": 0x26A69AFF,
    "release": 0x8D6E63FF,
    "withdraw": 0x607D8BFF,
}
"""Grey: through the air; brown: jaws; blue: bending; yellow: onto the pins; green: seated."""

_RED: Colour = [239, 83, 80]
_GREEN: Colour = [102, 187, 106]
_HOLE_COLOURS: tuple[Colour, ...] = (
    [70, 180, 255],
    [255, 165, 60],
    [171, 130, 255],
    [255, 235, 120],
)
_AXIS_COLOURS: tuple[Colour, ...] = (_RED, _GREEN, [70, 180, 255])

_SHEET_COLOURS = (0x546E7AFF, 0x78909CFF)

_LAID_COLOUR, _DISC_COLOUR, _RIM_COLOUR = [150, 165, 185], [20, 20, 24], [255, 255, 255]
_MEAN_CYCLES = 18
"""Cycles over which the robots, too, average what they feel of the hanging sheet."""

_DISC_M, _RIM_M = 8e-4, 1.5e-4
"""Thickness of a hole's disc and radius of the line round it: seen on both faces of the sheet."""


def states(result: RunResult) -> list[str]:
    """Return what each row's phase is called; a later attempt says which one it is."""
    trace = result.trace
    # A run that stops while it looks leaves its last row's attempt unwritten.
    attempts = np.nan_to_num(trace["attempt"]).astype(int)
    return [
        PHASES[phase] + (f" {attempt + 1}" if attempt else "")
        for phase, attempt in zip(trace["phase"].astype(int), attempts, strict=True)
    ]


def state_colours(names: list[str]) -> dict[str, int]:
    """Return a colour for each state; an attempt has that of its phase."""
    return {name: PHASE_COLOURS[name.rstrip(" 0123456789")] for name in dict.fromkeys(names)}


def log_sheet_lane(log: RecordingLog, result: RunResult) -> None:
    """Log which sheet of the book is being laid, where there is more than one."""
    assert result.scenario.assembly is not None
    book = result.scenario.assembly.sheets
    if book > 1 and result.trace.rows:
        starts = np.concatenate(([0], supply_rows(result)))
        names = [f"{i + 1} of {book}" for i in range(len(starts))]
        end = np.array([round(1e9 * COMMAND_PERIOD_S * result.trace.rows)], "timedelta64[ns]")
        colours = np.array([_SHEET_COLOURS[i % 2] for i in range(len(names))], dtype=np.uint32)
        log.once("sheet", rr.StateConfiguration(values=names, colors=colours))
        times = np.concatenate((log.times[starts], end))
        log.send("sheet", times, rr.StateChange.columns(state=[*names, ""]))


def log_holes(log: RecordingLog, result: RunResult, place: Vector, quaternion: Vector) -> None:
    """Log the holes as dark discs with a rim, at (rows, 4, 3) and (rows, 4, 4; w last)."""
    for i, hole in enumerate(HOLES):
        radius = result.model.site(f"hole_{hole}").size[0]
        turn = np.linspace(0.0, 2.0 * np.pi, 33)
        rim = radius * np.stack((np.cos(turn), np.sin(turn), 0.0 * turn), axis=1)
        log.once(
            f"cell/hole/{hole}",
            rr.Cylinders3D(
                lengths=[_DISC_M], radii=[radius], colors=_DISC_COLOUR, fill_mode="solid"
            ),
            rr.LineStrips3D([rim], colors=_RIM_COLOUR, radii=_RIM_M),
        )
        log.frames(
            f"cell/hole/{hole}",
            rr.Transform3D,
            translation=place[:, i].round(6),
            quaternion=quaternion[:, i],
        )


def log_laid(
    log: RecordingLog, result: RunResult, ribbon: Vector, triangles: NDArray[np.intp]
) -> None:
    """Log each laid sheet once, when it is left; ``ribbon`` is the moving one's vertices."""
    rows = supply_rows(result)
    for row in rows[rows >= log.done].tolist():
        entity = f"cell/laid/{int(result.trace['sheet'][row])}"
        look = rr.Mesh3D.from_fields(triangle_indices=triangles, albedo_factor=_LAID_COLOUR)
        log.replace(entity, look)
        vertices = rr.Mesh3D.columns(vertex_positions=ribbon[row - 1])
        left = vertices.partition([len(ribbon[row - 1])])
        log.send(entity, log.times[row : row + 1], left)


def carried(trace: Trace, place: Vector, delay_cycles: int) -> Vector:
    """Return where the bending frames were sent (rows, 4): the nominal place and the deviation."""
    deviation = np.stack([trace[f"object_deviation_{a}"] for a in ("x", "y", "yaw")], axis=1)
    sent = np.zeros_like(deviation)
    sent[delay_cycles:] = deviation[: len(deviation) - delay_cycles]
    moved = place.copy()
    moved[:, [0, 1, 3]] += sent
    return moved


def places(trace: Trace) -> Vector:
    """Return the nominal place of the bending frames (rows, 4): x, y, z [m], yaw [rad]."""
    return np.stack([trace[f"place_{name}"] for name in ("x", "y", "z", "yaw")], axis=1)


def log_contact(log: RecordingLog, trace: Trace) -> None:
    """Log what tells how the sheet goes over the pins."""
    labels = [hole.replace("_", " ") for hole in HOLES]
    named = list(zip(HOLES, labels, _HOLE_COLOURS, strict=True))
    log.lines(
        "pin_force",
        *((f"{text} [N]", trace[f"pin_force_{hole}"], colour, 1.5) for hole, text, colour in named),
    )
    axes = zip("xyz", contact_force(trace).T, _AXIS_COLOURS, strict=True)
    log.broken_line("contact_force", *((f"{a} [N]", force, look, 1.5) for a, force, look in axes))
    there = 1e3 * places(trace)
    named_axes = zip("xyz", there.T[:3], _AXIS_COLOURS, strict=True)
    log.lines(
        "path",
        *((f"{a} nominal [mm]", place, colour, 1.5) for a, place, colour in named_axes),
        every=FRAME_CYCLES,
    )
    log.lines(
        "object_deviation",
        ("x [mm]", 1e3 * trace["object_deviation_x"], _RED, 1.5),
        ("y [mm]", 1e3 * trace["object_deviation_y"], _GREEN, 1.5),
        ("yaw [deg]", np.degrees(trace["object_deviation_yaw"]), [171, 130, 255], 1.5),
    )
    off = {h: 1e3 * np.hypot(trace[f"hole_{h}_x"], trace[f"hole_{h}_y"]) for h in HOLES}
    log.lines("hole_offset", *((f"{t} [mm]", off[h], colour, 1.5) for h, t, colour in named))
    log.lines(
        "hole_height",
        *((f"{t} [mm]", 1e3 * trace[f"hole_{h}_z"], colour, 1.5) for h, t, colour in named),
    )


def contact_force(trace: Trace) -> Vector:
    """Return the force of pins and bed on the sheet, as the arms feel it (rows, 3) [N].

    The net force less its mean at the end of the phase ``bend``, when the sheet touched nothing;
    NaN where it is not lowered, seated or unfolded.
    """
    net = np.stack([trace[f"net_force_{a}"] for a in "xyz"], axis=1)
    phase, sheet = trace["phase"].astype(int), trace["sheet"]
    force = np.full_like(net, np.nan)
    down = (phase >= PHASES.index("lower")) & (phase <= PHASES.index("seat outer"))
    for number in np.unique(sheet[down & np.isfinite(sheet)]):
        free = np.flatnonzero((sheet == number) & (phase == PHASES.index("bend")))
        mine = down & (sheet == number)
        force[mine] = net[mine] - net[free[-_MEAN_CYCLES:]].mean(axis=0)
    return force
