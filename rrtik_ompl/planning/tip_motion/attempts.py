"""One attempt after the other to follow rails without collision, from one configuration or several."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import metres_per_radian
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.tip_motion.following import follow
from rrtik_ompl.planning.tip_motion.freedom import centred, redundant
from rrtik_ompl.planning.tip_motion.rails import Rail
from rrtik_ompl.planning.tip_motion.reasons import why_blocked, why_stopped
from rrtik_ompl.planning.tip_motion.values import SMALLEST_STEP, Leaning, Tolerance
from rrtik_ompl.world.world import World

HALVINGS = 14  # of a motion that is not proven, to find how far it is
LEFT = 1e-5  # [m] between what stops the arm and its last configuration, from which it has to get away again
ENDS = 8  # configurations at the end of the rails towards which a redundant arm is drawn
RANDOM_REFERENCES = 6
STRONG = 5.0  # how much a random reference draws
NO_LENGTH = 1e-12  # [m], a turn counted as `Way.measures` does
IK_SECONDS = 1e9  # no limit: the rounds of inverse kinematics are counted, some 10 ms of them


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Where the tip is to go, and how.

    Attributes:
        rails: One after the other.
        tolerance: How exactly to follow them.
        clearance: To be kept from obstacles [m]; None for what the world keeps.
        seed: Of the ways that a redundant arm tries.
    """

    rails: tuple[Rail, ...]
    tolerance: Tolerance
    clearance: float | None
    seed: int = 0

    def clearance_in(self, world: World) -> float:
        """The clearance to be kept from obstacles in a world [m]."""
        return world.settings.kept if self.clearance is None else self.clearance

    def leads_nowhere(self, robot: Robot) -> bool:
        """Whether its end is where it begins."""
        return bool(self.measures(robot).sum() <= NO_LENGTH)

    def measures(self, robot: Robot) -> Vector:
        """How much each rail counts [m]: its length, and its turn at the lever of half the arm's reach."""
        per_radian = metres_per_radian(robot)
        return np.array([rail.length + per_radian * abs(rail.turn_angle) for rail in self.rails])


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """How far one attempt came: configurations, shape (k, dof), their proof, the fraction, and why not farther."""

    rows: Matrix
    proof: Proof | None
    fraction: float
    reason: str

    @property
    def length(self) -> float:
        """Of the joints' way [rad, metres counted alike]."""
        return route_length(self.rows)


def farthest(world: World, way: Way, starts: Matrix) -> Attempt:
    """The attempt that comes farthest from any of some configurations, shape (k, dof); of several the shortest.

    A redundant arm that is stopped tries other ways to use its freedom.
    """
    best: Attempt | None = None
    for q in starts:
        for leaning in leanings(world, way, q):
            found = attempt(world, way, q, leaning)
            if best is None or (found.fraction, -found.length) > (best.fraction, -best.length):
                best = found
            if found.fraction == 1.0:
                break
        if best is not None and best.fraction == 1.0 and redundant(world.robot):
            break
    assert best is not None, "there is at least one start"
    return best


def leanings(world: World, way: Way, q: Vector) -> Iterator[Leaning]:
    """Ways to use the freedom that rails leave an arm at q, shape (dof,), the best first."""
    robot = world.robot
    usual = centred(robot)
    yield usual
    if not redundant(robot):
        return

    yield Leaning(usual.reference, np.zeros(robot.dof))
    free = (usual.pull > 0.0).astype(np.float64)
    if len(way.rails) == 1:
        goal = PoseGoal(way.rails[0].poses(1.0)[0])
        found = solve_ik(robot, goal, near=q, all=True, world=world, seconds=IK_SECONDS, seed=way.seed)
        for end in found.solutions[:ENDS]:
            yield Leaning(end, free, homing=True)
    rng = np.random.default_rng(way.seed)
    for _ in range(RANDOM_REFERENCES):
        yield Leaning(rng.uniform(*robot.finite_range()), STRONG * free)


def attempt(world: World, way: Way, q: Vector, leaning: Leaning) -> Attempt:
    """Follow the rails from a configuration, shape (dof,), and keep what is proven free."""
    robot = world.robot
    reason = ""
    parts = [robot.clamp(q)[None]]
    places = [np.zeros(1)]
    lengths = way.measures(robot)
    total = lengths.sum()
    for number, rail in enumerate(way.rails):
        followed = follow(robot, rail, parts[-1][-1], way.tolerance, leaning)
        parts.append(followed.rows[1:])
        places.append((lengths[:number].sum() + lengths[number] * followed.shares[1:]) / total)
        if not followed.complete:
            reason = why_stopped(robot, rail, followed)
            break

    rows = np.concatenate(parts)
    shares = np.concatenate(places)
    proof = world.prover.route(rows, clearance=way.clearance_in(world)) if len(rows) > 1 else None
    if proof is not None and not proof.proven:
        return _proven_part(world, way, rows, shares, proof)

    fraction = float(shares[-1])
    if not reason and fraction >= 1.0 - SMALLEST_STEP:
        fraction = 1.0
    return Attempt(rows, proof, fraction, reason)


def _proven_part(world: World, way: Way, rows: Matrix, shares: Vector, proof: Proof) -> Attempt:
    """The part before the first place that is not proven, which is found by halving the motion."""
    gap = proof.unproven[0]
    a = rows[gap.motion]
    b = rows[gap.motion + 1]
    clearance = way.clearance_in(world)

    proven_share = 0.0
    unproven_share = 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (proven_share + unproven_share)
        part = np.stack([a, a + middle * (b - a)])
        if world.prover.route(part, clearance=clearance, slack=LEFT).proven:
            proven_share = middle
        else:
            unproven_share = middle

    end = a + proven_share * (b - a)
    reason = why_blocked(world, end, b, (gap.first, gap.second))
    proven_rows = rows[: gap.motion + 1]
    fraction = float(shares[gap.motion])
    if proven_share > 0.0:
        proven_rows = np.vstack([proven_rows, end])
        fraction += proven_share * float(shares[gap.motion + 1] - shares[gap.motion])
    proven = world.prover.route(proven_rows, clearance=clearance) if len(proven_rows) > 1 else None
    return Attempt(proven_rows, proven, fraction, reason)


def path_of(world: World, found: Attempt) -> JointPath | None:
    """The path of an attempt with its proof; None if it did not begin to move."""
    if found.fraction <= 0.0:
        return None
    path = JointPath.of(world.robot, found.rows)
    return path if found.proof is None else path.with_proof(found.proof)
