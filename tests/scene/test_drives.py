"""What a drive's torque is in steps that treat its stiffness implicitly, and how it is limited."""

import mujoco
import numpy as np
import pytest

from dualbend.scene.observation import Drives

STIFFNESS, DAMPING, VISCOUS, STEP_S, STEPS = 2e4, 600.0, 10.0, 0.00175, 16
SPEED = 0.5
MODEL = f"""
<mujoco><option gravity="0 0 0" timestep="{STEP_S}"/><worldbody><body>
<joint name="j" axis="0 0 1" damping="{VISCOUS}" actuatorfrclimited="true"
actuatorfrcrange="-1e3 1e3"/>
<geom type="box" size=".3 .1 .1" mass="20" pos=".3 0 0"/></body></worldbody>
<actuator><position joint="j" kp="{STIFFNESS}" kv="{DAMPING}"/></actuator></mujoco>
"""


class Joint:
    """A joint that is sent along a ramp, with a torque limit."""

    def __init__(self, limit: float) -> None:
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        self.data = mujoco.MjData(self.model)
        self.limit, self.sent = limit, 0.0
        self.drives = Drives(np.array([limit]), np.array([STIFFNESS]), STEP_S)

    def run(self, cycles: int, *, speed: float = SPEED, ahead: bool = True) -> None:
        """Go on; ``ahead``: else MuJoCo limits what it tells."""
        for _ in range(cycles):
            here = self.drives.range(self.data.qvel)
            self.model.jnt_actfrcrange[:] = here if ahead else [-self.limit, self.limit]
            for _ in range(STEPS):
                self.sent += STEP_S * speed
                # Without error where the joint obeys the servo's equation.
                lead = (DAMPING + VISCOUS) * speed / STIFFNESS
                self.data.ctrl[0] = self.sent + lead
                mujoco.mj_step(self.model, self.data)

    @property
    def torque(self) -> float:
        return float(self.drives.torque(self.data.qfrc_actuator, self.data.qvel)[0])


def test_a_joint_at_a_steady_speed_needs_what_its_friction_takes() -> None:
    joint = Joint(1e3)
    joint.run(100)
    assert joint.data.qvel[0] == pytest.approx(SPEED, rel=1e-9)
    # Analytic: B v.
    assert joint.torque == pytest.approx(VISCOUS * SPEED, rel=1e-6)
    # MuJoCo tells k h v more.
    told = VISCOUS * SPEED + STIFFNESS * STEP_S * SPEED
    assert joint.data.qfrc_actuator[0] == pytest.approx(told, rel=1e-6)


@pytest.mark.parametrize(("ahead", "off_m"), [(True, 0.0), (False, 1e-4)])
def test_a_limit_above_what_is_needed_does_not_disturb(ahead: bool, off_m: float) -> None:
    """Three times B v, and less than what MuJoCo tells."""
    joint = Joint(15.0)
    # Slowly to speed, which takes 1.4 N m.
    for speed in np.linspace(0.0, SPEED, 100):
        joint.run(1, speed=float(speed), ahead=ahead)
    joint.run(50, ahead=ahead)
    error = abs(joint.sent - joint.data.qpos[0])
    assert error < 1e-6 if ahead else error > off_m
    assert abs(joint.torque) < joint.limit or not ahead


def test_a_joint_that_is_held_has_its_limit_and_no_more() -> None:
    joint = Joint(15.0)
    joint.data.qfrc_applied[0] = -40.0
    joint.run(3, speed=0.0)
    # Pushed on by what is beyond it, however fast: exact.
    assert joint.torque == joint.limit
