"""Jaws of the two grippers, which hold a sheet's end once both press on it."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.scene.cell import PAD_SITE
from dualbend.scene.contacts import GRIPPING
from dualbend.scene.mjcf import about_z
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.types import SIDES, Vector

_SQUEEZE_M = 4e-4
"""Distance beyond closed to which a jaw is driven: 8 N, less friction, on what is between them."""

_SQUEEZE_STEP_M = 2e-5
"""Growth of the squeeze in each cycle in which the jaws are to close."""

_LET_GO_M = 5e-4
"""Distance of a pad from the sheet's face at which the sheet is free."""

_WIDE_M = 3e-3
"""Distance at which a jaw that has let go can touch the sheet again."""


class Grippers:
    """Jaws that are driven to an opening, and the hold of the sheet's ends in their pads.

    The pads' rubber is the bushing of :mod:`dualbend.scene.cell`. A sheet that both jaws press is
    held as it lies: the jaws have centred its face between them; where its end is along the jaws'
    plane, and how it is turned in it, stays.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, thickness_m: float) -> None:
        self._model, self._data = model, data
        self._thickness_m = thickness_m
        jaws = [[f"{side}_{jaw}" for jaw in arm.JAW_JOINTS] for side in SIDES]
        self._jaw_q = np.array([[model.joint(j).qposadr[0] for j in pair] for pair in jaws]).T
        self._drives = np.array([[model.actuator(f"{j}_drive").id for j in p] for p in jaws])
        self._rubber = np.array([[model.geom(f"{j}_rubber").id for j in p] for p in jaws])
        self._pads = [model.site(f"{side}_{PAD_SITE}").id for side in SIDES]
        self._ends = [model.site(end).id for end in (LEFT_END, RIGHT_END)]
        self._end_place = model.site_pos[self._ends].copy()
        self._end_turn = model.site_quat[self._ends].copy()
        # A site that is parallel to its body is compiled to stay so: its quaternion goes unread.
        model.site_sameframe[self._ends] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        left, right = (model.equality(f"{side}_hold").id for side in SIDES)
        self._held = data.eq_active[left : right + 1]
        self._opening_m = self._squeeze_m = 0.0

    def reset(self, opening_m: float) -> None:
        """Open both jaws of each gripper, with no sheet held."""
        self._data.qpos[self._jaw_q] = opening_m
        for i in range(len(SIDES)):
            self._release(i)
        self._model.geom_conaffinity[self._rubber] = GRIPPING
        self.drive(opening_m)

    def drive(self, opening_m: float) -> None:
        """Drive each jaw to this distance from the middle [m]; 0 closes with force."""
        self._opening_m = opening_m
        # In small steps: a jaw that jumps would be through a thin sheet in one physics step.
        self._squeeze_m = min(self._squeeze_m + _SQUEEZE_STEP_M, _SQUEEZE_M)
        if opening_m > 0.0:
            self._squeeze_m = 0.0
        target = opening_m if opening_m > 0.0 else -self._squeeze_m
        for drives, held, gap in zip(self._drives, self.holding, self.gap_m, strict=True):
            # Jaws that hold stay where they are until they are opened: their spindle locks itself.
            if not held or 2.0 * opening_m > max(gap, 0.0):
                self._data.ctrl[drives] = target

    @property
    def gap_m(self) -> Vector:
        """Distance between the pads of each gripper (2,) [m], as its jaws' encoders tell."""
        upper, lower = self._data.qpos.take(self._jaw_q)
        return np.asarray(upper + lower)

    @property
    def holding(self) -> tuple[bool, bool]:
        """Which gripper holds the sheet."""
        left, right = self._held.tolist()
        return left, right

    def on_step(self) -> None:
        """Hold at once what both jaws press: a step later they would be through a thin sheet."""
        if self._opening_m < self._thickness_m and False in self._held.tolist():
            self.update()

    def update(self) -> None:
        """Hold what both jaws press, let go of what they no longer touch; once a cycle."""
        for i, (held, gap) in enumerate(zip(self.holding, self.gap_m.tolist(), strict=True)):
            if held and gap > self._thickness_m + 2.0 * _LET_GO_M:
                self._release(i)
            elif not held and gap > self._thickness_m + 2.0 * _WIDE_M:
                self._model.geom_conaffinity[self._rubber[i]] = GRIPPING
            elif not held and self._opening_m < self._thickness_m and self._pressed(i):
                self._hold(i)

    def _pressed(self, i: int) -> bool:
        geoms = self._data.contact.geom
        return all(bool((geoms == rubber).any()) for rubber in self._rubber[i])

    def _hold(self, i: int) -> None:
        """Weld the sheet to the pad where it is, in the plane of the sheet."""
        model, data = self._model, self._data
        body = model.site_bodyid[self._ends[i]]
        strip = data.xmat[body].reshape(3, 3)
        place = strip.T @ (data.site_xpos[self._pads[i]] - data.xpos[body])
        along = strip.T @ data.site_xmat[self._pads[i]].reshape(3, 3)[:, 0]
        yaw = float(np.arctan2(along[1], along[0]))
        model.site_pos[self._ends[i]] = place[0], place[1], 0.0
        model.site_quat[self._ends[i]] = about_z(yaw)
        self._held[i] = True
        data.ctrl[self._drives[i]] = data.qpos[self._jaw_q[:, i]]
        model.geom_conaffinity[self._rubber[i]] = 0

    def _release(self, i: int) -> None:
        self._model.site_pos[self._ends[i]] = self._end_place[i]
        self._model.site_quat[self._ends[i]] = self._end_turn[i]
        self._held[i] = False
