"""Inertia of a tool at its grip, against the mass matrix of the same bodies on a planar joint."""

import mujoco
import numpy as np
import pytest

from dualbend.mechanics.jacobian import PLANE, site_jacobian
from dualbend.mechanics.tool import tool_inertia
from dualbend.types import Vector

# The hand's joint is the planar motion of its grip: its mass matrix is the tool's inertia there.
CELL = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="before"><inertial pos="0 0 0" mass="40" diaginertia="1 1 1"/>
      <body name="left_hand" pos="0.3 0.1 0.7">
        <joint name="x" type="slide" axis="1 0 0"/>
        <joint name="z" type="slide" axis="0 0 1"/>
        <joint name="turn" type="hinge" axis="0 1 0" pos="0.1 0 -0.2"/>
        <inertial pos="0.03 0.01 -0.05" mass="2" diaginertia="0.03 0.02 0.04"
          quat="0.9 0.3 0.2 -0.1"/>
        <site name="left_grip" pos="0.1 0 -0.2"/>
        <body pos="0.02 0 -0.1" euler="0.4 0.2 -0.7">
          <inertial pos="0 0.01 -0.02" mass="0.7" diaginertia="0.003 0.001 0.0035"/>
          <body pos="0 0.05 0"><inertial pos="0 0 -0.1" mass="0.3" diaginertia="0.002 0.002 0.001"/>
          </body>
        </body>
      </body>
      <body name="beside"><inertial pos="0 0 3" mass="30" diaginertia="2 2 2"/>
        <body name="beyond"><inertial pos="0 0 3" mass="20" diaginertia="2 2 2"/></body>
      </body>
    </body>
    <body name="right_hand"><inertial pos="1 1 1" mass="50" diaginertia="3 3 3"/></body>
  </worldbody>
</mujoco>
"""


def cell(turn_rad: float) -> tuple[mujoco.MjModel, mujoco.MjData, int]:
    model = mujoco.MjModel.from_xml_string(CELL)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.05, -0.02, turn_rad
    mujoco.mj_forward(model, data)
    return model, data, model.site("left_grip").id


@pytest.mark.parametrize("turn_rad", [0.0, 0.8, -2.0])
def test_it_is_the_mass_matrix_of_the_grips_planar_motion(turn_rad: float) -> None:
    model, data, site = cell(turn_rad)
    mass: Vector = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, mass)
    # Analytic: the kinetic energy of the hand and of all that hangs on it, and of nothing else.
    np.testing.assert_allclose(tool_inertia(model, data, site), mass, rtol=1e-12, atol=1e-15)


def test_the_sites_jacobian_tells_its_planar_motion() -> None:
    model, data, site = cell(0.8)
    # Analytic: the joint is the grip's own x, z and turn; the rows are those of a twist of six.
    jacobian = site_jacobian(model, data, site)
    np.testing.assert_allclose(jacobian[list(PLANE)], np.eye(3), atol=1e-15)
    assert not jacobian[[1, 3, 5]].any()
