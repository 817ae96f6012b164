"""What a command cycle on a GPU needs beside MuJoCo Warp's own steps, as Warp kernels.

Every array has a leading axis of worlds; lengths, angles and forces are in SI units, float32.
"""

from __future__ import annotations

import mujoco
import warp as wp

PLANE, CAPSULE = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_CAPSULE)

wp.set_module_options({"enable_backward": False})


@wp.kernel
def feed_forward(
    bias: wp.array2d[float],
    held_up: wp.array2d[float],
    dofs: wp.array[int],
    compliance: wp.array2d[float],
    given: wp.array2d[float],
    own: wp.array[int],
    fed: wp.array2d[float],
) -> None:
    """Set what is added to a cycle's set-points [rad]: the own torque's, or what is given."""
    world, joint = wp.tid()
    dof = dofs[joint]
    if own[0] != 0:
        fed[world, joint] = (bias[world, dof] - held_up[world, dof]) * compliance[world, joint]
    else:
        fed[world, joint] = given[world, joint]


@wp.kernel
def drive(
    setpoints: wp.array3d[float], fed: wp.array2d[float], step: int, ctrl: wp.array2d[float]
) -> None:
    """Send the drives to a step's set-points."""
    world, joint = wp.tid()
    ctrl[world, joint] = setpoints[world, step, joint] + fed[world, joint]


@wp.kernel
def stribeck(
    speed: wp.array2d[float],
    dofs: wp.array[int],
    coulomb: wp.array2d[float],
    excess: wp.array2d[float],
    rate: wp.array[float],
    friction: wp.array2d[float],
) -> None:
    """Let dry friction follow the speeds: T = T_c + T_s exp(−(v/v_s)²), ``rate`` 1/v_s²."""
    world, joint = wp.tid()
    v = speed[world, dofs[joint]]
    level = coulomb[world, joint] + excess[world, joint] * wp.exp(-rate[world] * v * v)
    friction[world, dofs[joint]] = level


@wp.kernel
def note_faults(
    limit: float,
    ignored: int,
    overflow: wp.array[int],
    start: wp.array2d[float],
    ctrl: wp.array2d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    qacc: wp.array2d[float],
    warmstart: wp.array2d[float],
    fault: wp.array[int],
) -> None:
    """Note a world that is no longer valid and put it at rest in its start, out of harm's way."""
    world = wp.tid()
    bad = int(0)  # noqa: RUF046, UP018 - a variable of Warp's, no constant
    for i in range(qpos.shape[1]):
        if not wp.abs(qpos[world, i]) <= limit:  # true of NaN, too
            bad = bad | 1
    for i in range(qvel.shape[1]):
        if not wp.abs(qvel[world, i]) <= limit:
            bad = bad | 2
        if not wp.abs(qacc[world, i]) <= limit:
            bad = bad | 4
    for i in range(ctrl.shape[1]):
        if not wp.abs(ctrl[world, i]) <= limit:
            bad = bad | 8
    if (overflow[world] & ~ignored) != 0:
        bad = bad | 16
    if bad != 0:
        fault[world] = fault[world] | bad
        overflow[world] = 0
        for i in range(qpos.shape[1]):
            qpos[world, i] = start[world, i]
        for i in range(qvel.shape[1]):
            qvel[world, i] = 0.0
            qacc[world, i] = 0.0
            warmstart[world, i] = 0.0


@wp.kernel
def gather(
    source: wp.array2d[float],
    columns: wp.array[int],
    row: int,
    first: int,
    taken: wp.array3d[float],
) -> None:
    """Put columns of a field beside those of others, in a row for each world."""
    world, k = wp.tid()
    taken[row, world, first + k] = source[world, columns[k]]


@wp.struct
class Shape:
    """A box about a shape, whose edges and corners are rounded: a capsule's box is a line."""

    centre: wp.vec3
    axes: wp.mat33
    half: wp.vec3
    radius: float


@wp.func
def reach(shape: Shape, direction: wp.vec3) -> float:
    """Return how far a shape reaches from its centre along a direction of length one."""
    along = wp.transpose(shape.axes) @ direction
    return shape.radius + wp.dot(
        shape.half, wp.vec3(wp.abs(along[0]), wp.abs(along[1]), wp.abs(along[2]))
    )


@wp.func
def apart(a: Shape, b: Shape, direction: wp.vec3) -> bool:
    """Tell whether a direction separates two shapes; one of no length never does."""
    # Edges that are all but parallel tell nothing beyond the faces.
    if wp.length(direction) < 1e-2:
        return False
    unit = wp.normalize(direction)
    return wp.abs(wp.dot(b.centre - a.centre, unit)) > reach(a, unit) + reach(b, unit)


@wp.func
def shape_of(kind: int, size: wp.vec3, box: wp.vec3, centre: wp.vec3, axes: wp.mat33) -> Shape:
    """Return what is looked at of a geom: its capsule, or the box about it."""
    shape = Shape()
    shape.axes = axes
    shape.centre = centre
    shape.half = box
    if kind == wp.static(CAPSULE):
        shape.half = wp.vec3(0.0, 0.0, size[1])
        shape.radius = size[0]
    return shape


@wp.kernel
def overlap(
    pairs: wp.array[wp.vec2i],
    kind: wp.array[int],
    size: wp.array2d[wp.vec3],
    aabb: wp.array3d[wp.vec3],
    xpos: wp.array2d[wp.vec3],
    xmat: wp.array2d[wp.mat33],
    touching: wp.array[int],
) -> None:
    """Note worlds in which two shapes that may collide are not seen to be apart.

    A face of either, or an edge of each, separates boxes that are apart; of a plane, its normal. So
    nothing that touches is missed; a round end beside an edge may be taken for touching.
    """
    world, pair = wp.tid()
    g, h = pairs[pair][0], pairs[pair][1]
    if kind[h] == wp.static(PLANE):
        g, h = h, g
    row, boxes = world % size.shape[0], world % aabb.shape[0]
    axes = xmat[world, h]
    centre = xpos[world, h] + axes @ aabb[boxes, h, 0]
    b = shape_of(kind[h], size[row, h], aabb[boxes, h, 1], centre, axes)
    if kind[g] == wp.static(PLANE):
        normal = wp.transpose(xmat[world, g])[2]
        if wp.dot(b.centre - xpos[world, g], normal) <= reach(b, normal):
            touching[world] = 1
        return
    axes = xmat[world, g]
    centre = xpos[world, g] + axes @ aabb[boxes, g, 0]
    a = shape_of(kind[g], size[row, g], aabb[boxes, g, 1], centre, axes)
    if wp.length(b.centre - a.centre) > (
        wp.length(a.half) + a.radius + wp.length(b.half) + b.radius
    ):
        return
    for i in range(3):
        if apart(a, b, wp.transpose(a.axes)[i]) or apart(a, b, wp.transpose(b.axes)[i]):
            return
    for i in range(3):
        for j in range(3):
            if apart(a, b, wp.cross(wp.transpose(a.axes)[i], wp.transpose(b.axes)[j])):
                return
    touching[world] = 1
