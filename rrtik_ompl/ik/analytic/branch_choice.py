"""Choice of a branch of a closed form: the one nearest to a configuration, or one for each point of a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.analytic.closed_form import SWEEP, ClosedForm, form_of, solutions
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits

JUMP = 0.2  # [rad] or [m]: a larger change of a joint between two points means another branch, not motion
JUMP_COST = 1e3  # cost of a jump, more than any motion can cost
TIE = 1e-9  # Distances that differ by less count as equal.
MAX_CANDIDATES = 32  # number of candidates that are kept for a singular point
MOST_TURNED = 1024  # number of candidates of a point in all turns; for two points, all pairs of them are compared
REFINEMENTS = 6  # number of sweeps along the curve of a singular pose, each 18 times finer than the one before


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Configurations along a trajectory.

    Attributes:
        q: Configurations, shape (k, dof); NaN where no branch reaches the target inside the limits.
        branch: Label of the branch of each point, "" where there is none.
        jumps: Indices of points at which a joint moves by more than the allowed jump, or that follow a gap.
        changes: Indices of points at which the label changes; at a singularity that need not be a jump.
        gaps: Indices of points without a configuration.
    """

    q: Matrix
    branch: tuple[str, ...]
    jumps: tuple[int, ...]
    changes: tuple[int, ...]
    gaps: tuple[int, ...]


def nearest(
    robot: Robot, targets: ArrayLike, near: ArrayLike, *, weights: ArrayLike | None = None
) -> tuple[Matrix, Mask]:
    """Find for each target the solution inside the limits that is nearest to a configuration.

    Of equally near solutions the one farthest from the limits is taken. For a singular target the whole curve of
    solutions is considered, not only its representatives.

    Args:
        robot: An arm with a closed form.
        targets: T_world_tip, shape (m, 4, 4), or points, shape (m, 3).
        near: Configuration, shape (dof,), or one for each target, shape (m, dof).
        weights: Weights of the joints in the distance, shape (dof,); ones if None.

    Returns:
        Configurations, shape (m, dof), NaN where there is none, and whether there is one, shape (m,).
    """
    goals = np.asarray(targets, dtype=np.float64)
    hints = np.broadcast_to(np.asarray(near, dtype=np.float64), (len(goals), robot.dof))
    scale = np.ones(robot.dof) if weights is None else finite_array(weights, (robot.dof,), "weights")

    found = solutions(robot, goals, near=hints, check=False)
    cost = np.where(found.valid, _distance(robot, found.branches, hints[:, None], scale), np.inf)
    margin = np.min(np.minimum(found.branches - robot.lower, robot.upper - found.branches), axis=2)
    least_distance = cost.min(axis=1)
    best = np.argmax(np.where(cost <= least_distance[:, None] + TIE, margin, -np.inf), axis=1)

    q = found.branches[np.arange(len(goals)), best].copy()
    reached = np.isfinite(least_distance)
    for k in np.flatnonzero(found.singular):  # A loop is fast enough, since singular poses are rare.
        member, distance = _nearest_member(robot, goals[k], hints[k], scale)
        if distance < least_distance[k]:
            q[k] = member
            reached[k] = True

    q[~reached] = np.nan
    return q, reached


def _distance(robot: Robot, q: NDArray[np.float64], near: NDArray[np.float64], scale: Vector) -> NDArray[np.float64]:
    """Return the weighted joint distance between configurations, shapes (..., dof); shape (...)."""
    distance: NDArray[np.float64] = np.linalg.norm(joint_difference(robot, q, near) * scale, axis=-1)
    return distance


def _nearest_member(robot: Robot, goal: Matrix, near: Vector, scale: Vector) -> tuple[Vector, float]:
    """Find the member of a singular target's curve, inside the limits, that is nearest to a configuration.

    The whole curve is sampled first, then ever smaller intervals around the best value of the free angle.

    Args:
        robot: The arm.
        goal: T_world_tip, shape (4, 4), or a point, shape (3,).
        near: The configuration, shape (dof,).
        scale: Weights of the joints, shape (dof,).

    Returns:
        The member, shape (dof,), and its distance; inf if there is none inside the limits.
    """
    free = list(form_of(robot).free)
    member = near
    least_distance = np.inf
    centre = 0.0
    width = np.pi

    for _ in range(REFINEMENTS):
        hints = np.tile(near, (SWEEP + 1, 1))
        values = centre + width * np.linspace(-1.0, 1.0, SWEEP + 1)
        hints[:, free] = values[:, None]
        hints[:, [j for j in range(robot.dof) if j not in free]] = 0.0
        found = solutions(robot, np.broadcast_to(goal, (len(hints), *goal.shape)), near=hints, check=False)
        distance = np.where(found.valid, _distance(robot, found.branches, near, scale), np.inf)
        row, branch = np.unravel_index(int(np.argmin(distance)), distance.shape)

        if distance[row, branch] < least_distance:
            member = found.branches[row, branch]
            least_distance = float(distance[row, branch])
        centre = values[row]
        width = 4.0 * width / SWEEP
    return member, least_distance


def follow(
    robot: Robot,
    targets: ArrayLike,
    near: ArrayLike | None = None,
    *,
    jump: float = JUMP,
    accept: Callable[[Matrix], Mask] | None = None,
) -> Track:
    """Choose one solution for each point of a trajectory, with the fewest jumps and then the least motion.

    Dynamic programming finds the shortest path through the layers of branches, so a branch that would run into a limit
    later is not taken in the first place. Singular points are solved near each solution of the point before.

    Args:
        robot: An arm with a closed form.
        targets: T_world_tip, shape (k, 4, 4), or points, shape (k, 3).
        near: Configuration before the first point, shape (dof,); any if None.
        jump: Motion of one joint between two points [rad or m] above which it counts as a jump.
        accept: Checks which solutions, shape (k, dof), are acceptable and returns shape (k,); all inside the limits if
            None.

    Raises:
        InputError: If the robot has no closed form, or a target is no pose.
    """
    goals = np.asarray(targets, dtype=np.float64)
    if len(goals) == 0:
        raise InputError("targets: a trajectory needs at least one point")

    found = solutions(robot, goals, near=near, check=False)
    before = np.zeros((1, robot.dof)) if near is None else robot.configuration(near)[None]
    cost = np.zeros(1)
    layers: list[_Layer] = []

    for k in range(len(goals)):
        q, tags = _candidates(robot, goals[k], found, k, before)
        if accept is not None and len(q):
            good = accept(q)
            q = q[good]
            tags = tags[good]

        parent = np.zeros(len(q), dtype=np.int64)
        if len(q):
            # Motion to the first point costs nothing, unless a configuration before it is given.
            price = _price(robot, q, before, jump) if near is not None or any(len(each.q) for each in layers) else 0.0
            total = price + np.broadcast_to(cost, (len(q), len(before)))
            parent = np.argmin(total, axis=1)
            before = q
            cost = total[np.arange(len(q)), parent]
        layers.append(_Layer(q, tags, parent))

    return _track(robot, layers, int(np.argmin(cost)), None if near is None else robot.configuration(near), jump)


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    """The candidates of one point.

    Attributes:
        q: Configurations, shape (c, dof); none for a gap.
        tags: Number of the branch of each, shape (c,).
        parent: Index of the best predecessor of each in the last layer that has candidates, shape (c,).
    """

    q: Matrix
    tags: NDArray[np.int64]
    parent: NDArray[np.int64]


def _price(robot: Robot, q: Matrix, before: Matrix, jump: float) -> Matrix:
    """Return the cost of the motion from each row of ``before``, shape (b, dof), to each row of q, shape (c, dof).

    A jump costs more than any motion. Shape (c, b).
    """
    step = np.abs(joint_difference(robot, q[:, None], before[None]))
    price: Matrix = np.linalg.norm(step, axis=2) + JUMP_COST * (step.max(axis=2) > jump)
    return price


def _candidates(
    robot: Robot, goal: Matrix, found: ClosedForm, k: int, before: Matrix
) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the candidates of a point: solutions inside the limits, in all full turns, and their branches.

    Args:
        robot: The arm.
        goal: Target of the point.
        found: Branches of all points.
        k: Index of the point.
        before: Candidates of the point before, shape (b, dof); a singular point is solved near each of them.

    Returns:
        Configurations, shape (c, dof), and numbers of their branches, shape (c,).
    """
    if not found.singular[k]:
        tags = np.flatnonzero(found.valid[k])
        return _in_every_turn(robot, found.branches[k, tags], tags)

    close = solutions(robot, np.broadcast_to(goal, (len(before), *goal.shape)), near=before, check=False)
    hints, tags = np.nonzero(close.valid)
    q = close.branches[hints, tags]
    nearest_first = np.argsort(np.linalg.norm(q - before[hints], axis=1), kind="stable")[:MAX_CANDIDATES]
    return q[nearest_first], tags[nearest_first]


def _in_every_turn(robot: Robot, q: Matrix, tags: NDArray[np.int64]) -> tuple[Matrix, NDArray[np.int64]]:
    """Return configurations together with those in which joints are moved by full turns within their limits.

    If there would be more than `MOST_TURNED` rows, further joints are not moved.

    Args:
        robot: The arm.
        q: Configurations, shape (c, dof).
        tags: A number for each, which its copies take over, shape (c,).
    """
    span = robot.upper - robot.lower
    for joint in np.flatnonzero(~robot.prismatic & ~robot.continuous & (span >= TAU)):
        rows = [q]
        owners = [tags]
        max_turns = int(span[joint] / TAU)
        for turn in (*range(-max_turns, 0), *range(1, max_turns + 1)):
            other = q.copy()
            other[:, joint] += turn * TAU
            fits = inside_limits(robot, other)
            rows.append(other[fits])
            owners.append(tags[fits])

        if sum(map(len, rows)) > MOST_TURNED:
            break
        q = np.vstack(rows)
        tags = np.concatenate(owners)
    return q, tags


def _track(robot: Robot, layers: list[_Layer], last: int, near: Vector | None, jump: float) -> Track:
    """Trace the best path back from its last candidate and find its jumps, changes of branch and gaps.

    Args:
        robot: The arm.
        layers: Candidates of all points.
        last: Index of the best candidate in the last layer that has any.
        near: Configuration before the first point, shape (dof,), or None.
        jump: Largest motion of a joint that is no jump [rad or m].
    """
    labels = form_of(robot).branches
    q = np.full((len(layers), robot.dof), np.nan)
    branch = [""] * len(layers)

    for k in range(len(layers) - 1, -1, -1):
        if len(layers[k].q):
            q[k] = layers[k].q[last]
            branch[k] = labels[layers[k].tags[last]]
            last = int(layers[k].parent[last])

    gaps = [k for k, label in enumerate(branch) if not label]
    jumps = []
    changes = []
    previous = near
    label = ""

    for k in range(len(layers)):
        if not branch[k]:
            continue
        if previous is not None:
            step = joint_difference(robot, q[k], previous)
            q[k] = np.where(robot.continuous, previous + step, q[k])
            if np.abs(step).max() > jump or k - 1 in gaps:
                jumps.append(k)
        if label not in ("", branch[k]):
            changes.append(k)
        previous = q[k]
        label = branch[k]

    return Track(frozen(q), tuple(branch), tuple(jumps), tuple(changes), tuple(gaps))
