"""Proof that no motion of the arm rules out a contact: whatever it does, some obstacle can touch it in time.

The configurations that the arm can reach by a time are covered by boxes. In each box one obstacle, grown by what the
bound on its speed allows until then, touches one link in all configurations: at the centre of the box it is nearer than
its growth, by more than any point of the arm moves within the box. A link that never moves is one such link everywhere.
docs/science/evasion.md has the theorem.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.world.world import World

MOST_BOXES = 4096  # after which a proof is given up, for an arm of few joints
MANY_JOINTS = 4
FEW_BOXES = 64  # the same for an arm of so many joints or more, whose boxes are too many to be cut small
ROUNDING = 1e-6  # [m] of distances


class ContactWarning(UserWarning):
    """It is proven that no motion of the arm rules out a contact."""


@dataclass(frozen=True, slots=True, eq=False)
class Unavoidable:
    """A proof that contact cannot be ruled out in a tick, for each motion that the arm could make.

    Attributes:
        seconds: Time from the begin of the tick by which an obstacle can touch the arm [s].
        lower, upper: Corners of boxes that cover all configurations which the arm can reach by then, shape (k, n).
        pairs: For each box a link and an obstacle that can touch it by then, wherever in the box the arm is.
        distances: For each box the distance of this obstacle, where it was seen, from the link at the centre [m], shape
            (k,).
    """

    seconds: float
    lower: Matrix
    upper: Matrix
    pairs: tuple[tuple[str, str], ...]
    distances: Vector

    __reduce__ = as_value

    @property
    def sentence(self) -> str:
        """What is proven, in one line."""
        names = ", ".join(f"'{name}'" for name in dict.fromkeys(obstacle for _, obstacle in self.pairs))
        return f"no motion of the arm rules out a contact with {names} within {self.seconds:.3g} s, which is proven"


def unavoidable(
    world: World, q: Vector, growths: Mapping[str, float], seconds: float, *, step: float, max_change: Vector
) -> Unavoidable | None:
    """Return a proof that the arm cannot rule out a contact by a time, or None if none was found.

    Args:
        world: The robot and the obstacles where they were seen.
        q: The robot's configuration, shape (n,).
        growths: How far each obstacle may be from there by that time [m], by name.
        seconds: The time, from now [s].
        step: How far the arm can go until then [unit of the space].
        max_change: How far each joint can move until then [rad or m], shape (n,).
    """
    robot = world.robot
    change = np.minimum(max_change, step)
    lower = np.maximum(q - change, robot.lower)[None]
    upper = np.minimum(q + change, robot.upper)[None]
    if (base := _base_touched(world, q, growths)) is not None:
        return Unavoidable(seconds, lower, upper, (base[0],), np.array([base[1]]))

    proven: list[tuple[Vector, Vector, tuple[str, str], float]] = []
    asked = 0
    while len(lower) > 0:
        asked += len(lower)
        if asked > (MOST_BOXES if robot.dof < MANY_JOINTS else FEW_BOXES):
            return None
        centres = 0.5 * (lower + upper)
        pairs, distances, beside = _nearest(world, centres, growths)
        touched = beside + 0.5 * (upper - lower) @ world.weights < -ROUNDING
        proven += [(lower[k], upper[k], pairs[k], float(distances[k])) for k in np.flatnonzero(touched).tolist()]

        # A centre that the arm can reach and no obstacle can ends the search: there is no proof.
        if ((np.linalg.norm(centres - q, axis=1) <= step) & (beside > 0.0)).any():
            return None
        lower, upper = _halves(lower[~touched], upper[~touched], world.weights)
        within = np.linalg.norm(np.clip(q, lower, upper) - q, axis=1) <= step
        lower, upper = lower[within], upper[within]

    lows, highs, touching, near = zip(*proven, strict=True)
    return Unavoidable(seconds, np.array(lows), np.array(highs), tuple(touching), np.array(near))


def _base_touched(world: World, q: Vector, growths: Mapping[str, float]) -> tuple[tuple[str, str], float] | None:
    """Return a link that never moves and an obstacle that can touch it, with their distance [m]; None without any.

    Coal measures these few pairs: to pack a new scene for kernels would take far longer.
    """
    bodies = world.bodies
    pairs_at_rest = [pair for pair in world.pairs if all(bodies[k].joint == 0 for k in pair)]
    frames = world.robot.chain.joint_frames(q[None])[0]

    def beside(contact: Contact) -> float:
        return contact.distance - growths[_link_first(contact.first, contact.second, growths)[1]]

    nearest = min(measured(bodies, pairs_at_rest, frames, near_only=False), key=beside, default=None)
    if nearest is None or beside(nearest) >= -ROUNDING:
        return None
    return _link_first(nearest.first, nearest.second, growths), nearest.distance


def _link_first(first: str, second: str, growths: Mapping[str, float]) -> tuple[str, str]:
    """Return the names of a pair, that of the obstacle last."""
    return (first, second) if second in growths else (second, first)


def _nearest(world: World, rows: Matrix, growths: Mapping[str, float]) -> tuple[list[tuple[str, str]], Vector, Vector]:
    """Return for configurations, shape (m, n), the link and the obstacle that is nearest beside its growth.

    Returns:
        The pairs, their distances, and their distances less the growth [m], shape (m,).
    """
    found = world.distances(rows)
    pairs = [_link_first(*pair, growths) for pair in found.names]
    beside = found.values - [growths.get(obstacle, -np.inf) for _, obstacle in pairs]
    nearest = np.argmin(beside, axis=1)
    at = np.arange(len(rows)), nearest
    return [pairs[k] for k in nearest.tolist()], found.values[at], beside[at]


def _halves(lower: Matrix, upper: Matrix, weights: Vector) -> tuple[Matrix, Matrix]:
    """Return both halves of boxes, cut across the edge along which the arm moves most."""
    axes = np.argmax((upper - lower) * weights, axis=1)
    rows = np.arange(len(lower))
    middles = 0.5 * (lower[rows, axes] + upper[rows, axes])
    first_upper = upper.copy()
    first_upper[rows, axes] = middles
    second_lower = lower.copy()
    second_lower[rows, axes] = middles
    return np.vstack([lower, second_lower]), np.vstack([first_upper, upper])
