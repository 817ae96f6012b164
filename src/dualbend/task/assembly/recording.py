"""What an assembly's recording shows beside a bending's: bed, pins, holes, laid sheets, contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.recording.geometry import Motion, log_axes, shapes_of, sites
from dualbend.recording.layers import TITLES, Layers, Views, gripper_view, view
from dualbend.recording.log import Colour, RecordingLog
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.scene.bed.config import LayoutConfig, hole_places
from dualbend.scene.bed.mjcf import laid_body
from dualbend.scene.sheet.strips import strip_body
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import holes_of
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.program.state import mean_cycles
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
    "check seats": 0x00897BFF,
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
_AXIS_COLOURS: tuple[Colour, ...] = (_RED, _GREEN, _HOLE_COLOURS[0])

_SHEET_COLOURS = (0x546E7AFF, 0x78909CFF)

_LAID_COLOUR, _DISC_COLOUR, _RIM_COLOUR = [150, 165, 185], [20, 20, 24], [255, 255, 255]

_DISC_M, _RIM_M = 8e-4, 1.5e-4
"""Thickness of a hole's disc and radius of the line round it: seen on both faces of the sheet."""

_TITLES = {
    "hole_offset": "Holes off their pins, horizontally [mm]",
    "pin_force": "Force on the pins [N]",
    "moment": TITLES["moment"],
    "path": "Path: place of the sheet [mm]",
    "object_deviation": "Deviation by compliance, of the whole sheet [mm, deg]",
    "contact_force": "Contact force on the sheet, as the arms feel it [N]",
    "hole_height": "Height of the holes above the bed [mm]",
    **{key: TITLES[key] for key in ("force", "angle", "ik", "torque")},
}

_NEAR_MM = {"hole_offset": (0.0, 2.5), "hole_height": (-0.5, 12.0)}
"""What the plots of the holes show at first: while a sheet is carried they are far off."""

_UNCLUTTERED = ["+ $origin/**", "- $origin/wrench/**", "- $origin/grip/**", "- $origin/path/**"]

_HANGS_BENT = ("bend", "lower", "seat middle", "unfold")
"""Phases of an assembly in which the sheet is a rod between two grips, and bent.

Flat, between grips as far apart as it is long, its moment hangs on micrometres.
"""

_LEAST_BEND_RAD = 0.02


class AssemblyLayers(Layers):
    """Bed, pins, holes and laid sheets in the scene; contact, place and holes in the plots."""

    guide = (
        "Drag the white line in a plot or press play: every panel shows the same moment of the "
        "run. Left: the cell, the bed with its pins, each pin and one gripper close up "
        "(tabs); below them, what the robots were doing. Right: how far each hole is from its "
        "pin, what the pins and the bending do. A sheet is laid when all holes are within "
        "half their clearance and down on the bed."
    )
    predicted = (
        " **predicted** is beam theory for these poses, without pins, while the sheet hangs bent: "
        "where true leaves it, the sheet swings or touches something."
    )
    legend = (
        '* phases: "lower 2" is the second attempt to lower',
        "* brass: the pins; dark discs with a white rim: the sheet's holes; pale: sheets laid "
        "before",
    )
    titles = _TITLES
    ranges = _NEAR_MM
    camera = "bed"

    def states(self, result: RunRecord) -> list[str]:
        """Return what each row's phase is called; a later attempt says which one it is."""
        trace = result.trace
        # A run that stops while it observes leaves its last row's attempt unwritten.
        attempts = np.nan_to_num(trace["attempt"]).astype(int)
        return [
            PHASES[phase] + (f" {attempt + 1}" if attempt else "")
            for phase, attempt in zip(trace["phase"].astype(int), attempts, strict=True)
        ]

    def colours(self, result: RunRecord, names: Sequence[str]) -> dict[str, int]:
        """Return a colour for each state; an attempt has that of its phase."""
        del result
        return {name: PHASE_COLOURS[name.rstrip(" 0123456789")] for name in dict.fromkeys(names)}

    def log_series(self, log: RecordingLog, result: RunRecord) -> None:
        """Log what tells how the sheet goes over the pins."""
        trace, holes = result.trace, holes_of(result)

        def by_hole(entity: str, unit: str, of: Callable[[str], Vector]) -> None:
            named = zip(holes, cycle(_HOLE_COLOURS), strict=False)
            lines = ((f"{_words(h)} [{unit}]", of(h), colour, 1.5) for h, colour in named)
            log.lines(entity, *lines)

        by_hole("pin_force", "N", lambda hole: trace[f"pin_force_{hole}"])
        axes = zip(
            "xyz", contact_force(trace, result.scenario.period_s).T, _AXIS_COLOURS, strict=True
        )
        log.broken_line("contact_force", *((f"{a} [N]", f, look, 1.5) for a, f, look in axes))
        axes = zip("xyz", 1e3 * places(trace).T[:3], _AXIS_COLOURS, strict=True)
        nominal = ((f"{a} nominal [mm]", place, look, 1.5) for a, place, look in axes)
        log.lines("path", *nominal, every=log.frame)
        log.lines(
            "object_deviation",
            ("x [mm]", 1e3 * trace["object_deviation_x"], _RED, 1.5),
            ("y [mm]", 1e3 * trace["object_deviation_y"], _GREEN, 1.5),
            ("yaw [deg]", np.degrees(trace["object_deviation_yaw"]), _HOLE_COLOURS[2], 1.5),
        )
        off = {h: np.hypot(trace[f"hole_{h}_x"], trace[f"hole_{h}_y"]) for h in holes}
        by_hole("hole_offset", "mm", lambda hole: 1e3 * off[hole])
        by_hole("hole_height", "mm", lambda hole: 1e3 * trace[f"hole_{hole}_z"])

    def log_lanes(self, log: RecordingLog, result: RunRecord) -> None:
        """Log which sheet of the stack is being laid, where there is more than one."""
        stack, rows = assembly_of(result.scenario).sheets, result.trace.rows
        if stack == 1 or not rows:
            return
        starts = np.concatenate(([0], supply_rows(result)))
        names = [f"{i + 1} of {stack}" for i in range(len(starts))]
        colours = np.resize(np.array(_SHEET_COLOURS, dtype=np.uint32), len(names))
        log.once("sheet", rr.StateConfiguration(values=names, colors=colours))
        end = np.array([round(1e9 * result.scenario.period_s * rows)], "timedelta64[ns]")
        times = np.concatenate((log.times[starts], end))
        log.send("sheet", times, rr.StateChange.columns(state=[*names, ""]))

    def log_grip(
        self, log: RecordingLog, result: RunRecord, motion: Motion, side: str, sign: float
    ) -> None:
        """Log where a grip is, wherever its bending frame was carried."""
        del sign
        place, turn = sites(result.model, motion, [f"{side}_{GRIP_SITE}"])
        log_axes(log, f"cell/grip/{side}_actual", 0.03, place[:, 0], turn[:, 0])

    def log_scene(
        self,
        log: RecordingLog,
        result: RunRecord,
        motion: Motion,
        ribbon: Vector,
        triangles: NDArray[np.intp],
    ) -> None:
        """Log bed, stand and pins, the holes, and the sheets that are laid."""
        model, holes = result.model, holes_of(result)
        log.once("cell/workplace", *shapes_of(model, 0))
        for hole in holes:
            body = model.body(f"pin_{hole}")
            pose = rr.Transform3D(translation=body.pos, quaternion=body.quat[[1, 2, 3, 0]])
            log.once(f"cell/pin/{hole}", *shapes_of(model, body.id), pose)
        log_holes(log, result, *sites(model, motion, [f"hole_{hole}" for hole in holes]))
        log_laid(log, result, ribbon, triangles)

    def places(self, result: RunRecord) -> tuple[Vector, Vector]:
        """Return where the bending frames are to be and were sent (rows, 4): x, y, z [m], yaw."""
        there = places(result.trace)
        return there, carried(result.trace, there, result.scenario.robot.longest_delay)

    def views(self, result: RunRecord) -> Views:
        """Return the views of the cell and the bed, and of each pin as tabs."""
        config = assembly_of(result.scenario)
        height, several = result.scenario.cell.sheet_height_m, config.sheets > 1
        cell = view("Cell", [0.0, -2.2, height + 0.6], [0.0, 0.0, height - 0.1])
        bed, *pins = _close_ups(config.layout)
        lane = rrb.StateTimelineView(origin="phase", name="Phase")
        if several:
            lane = rrb.StateTimelineView(origin="/", contents=["phase", "sheet"], name="Phase")
        return Views(
            top=[cell, bed],
            near=rrb.Tabs(*pins, gripper_view(result), active_tab=0),
            lane=lane,
            shares=[4.0, 3.6, 1.5 if several else 0.9],
        )

    def predictable(self, result: RunRecord, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of the rows in which the sheet hangs bent between the grips."""
        trace = result.trace
        phases = [PHASES.index(phase) for phase in _HANGS_BENT]
        bent = trace["left_grip_alpha"][rows] > _LEAST_BEND_RAD
        return rows[np.isin(trace["phase"][rows], phases) & bent]

    def pose_others(
        self, model: mujoco.MjModel, data: mujoco.MjData, result: RunRecord, row: int
    ) -> None:
        """Put the plates of the sheets that are laid by ``row`` where they rest."""
        for number, supplied in enumerate(supply_rows(result)):
            if supplied > row:
                return
            data.qpos[:] = result.trace.qpos[supplied - 1]
            mujoco.mj_kinematics(model, data)
            for i in range(result.scenario.sheet.model.sections + 1):
                mocap = model.body_mocapid[model.body(laid_body(number, i)).id]
                strip = model.body(strip_body(i)).id
                # A strip's centre of mass is its plate's middle.
                data.mocap_pos[mocap] = data.xipos[strip]
                data.mocap_quat[mocap] = data.xquat[strip]

    def close_up(self, result: RunRecord, row: int) -> tuple[mujoco.MjvCamera, str] | None:
        """Return the view of the pin that a hole is just going over."""
        camera, layout = mujoco.MjvCamera(), assembly_of(result.scenario).layout
        first = result.trace["phase"][row] <= PHASES.index("unfold")
        pin = layout.holes.groups.index("middle" if first else "outer")
        height = layout.pins.height_m
        camera.lookat[:] = [*hole_places(layout.holes)[pin], layout.bed.top_m + 0.5 * height]
        # From the front and above, a few heights away.
        camera.distance, camera.azimuth, camera.elevation = 7.0 * height, 75.0, -38.0
        return camera, f"{_words(layout.holes.names[pin])} pin"


LAYERS = AssemblyLayers()


def log_holes(log: RecordingLog, result: RunRecord, place: Vector, quaternion: Vector) -> None:
    """Log the holes as dark discs with a rim, at (rows, n, 3) and (rows, n, 4; w last)."""
    for i, hole in enumerate(holes_of(result)):
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
    log: RecordingLog, result: RunRecord, ribbon: Vector, triangles: NDArray[np.intp]
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


def contact_force(trace: Trace, period_s: float) -> Vector:
    """Return the force of pins and bed on the sheet, as the arms feel it (rows, 3) [N].

    The net force less its mean at the end of the phase ``bend``, when the sheet touched nothing;
    NaN where it is not lowered, seated or unfolded.
    """
    net = np.stack([trace[f"net_force_{a}"] for a in "xyz"], axis=1)
    phase, sheet = trace["phase"].astype(int), trace["sheet"]
    force = np.full_like(net, np.nan)
    down = (phase >= PHASES.index("lower")) & (phase < PHASES.index("release"))
    for number in np.unique(sheet[down & np.isfinite(sheet)]):
        free = np.flatnonzero((sheet == number) & (phase == PHASES.index("bend")))
        mine = down & (sheet == number)
        force[mine] = net[mine] - net[free[-mean_cycles(period_s) :]].mean(axis=0)
    return force


def supply_rows(result: RunRecord) -> NDArray[np.intp]:
    """Return the rows in which the next sheet is on the stand: one fewer than sheets were laid.

    In the row before each of them the sheet is where it stays.
    """
    return 1 + np.flatnonzero(np.diff(result.trace["sheet"]) > 0.0)


def _words(hole: str) -> str:
    return hole.replace("_", " ")


def _close_ups(workplace: LayoutConfig) -> list[rrb.Spatial3DView]:
    """Return the views of the bed and of each pin, without the arrows and axes."""
    top, half = workplace.bed.top_m, workplace.bed.half_length_m
    views = [
        view("Bed", [0.0, -2.6 * half, top + 2.2 * half], [0.0, 0.2 * half, top], _UNCLUTTERED)
    ]
    for hole, (x, y) in zip(workplace.holes.names, hole_places(workplace.holes), strict=True):
        name, at = f"Pin {_words(hole)}", [x, y, top + 0.004]
        views.append(view(name, [x + 0.010, y - 0.032, top + 0.024], at, _UNCLUTTERED))
    return views
