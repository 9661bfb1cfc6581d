"""Attempts to follow rails without collision, and explanations of why the tip cannot go on along one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.units import shown_unit
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot, metres_per_radian
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.tip_motion.following import (
    MOST_ROWS,
    SMALLEST_STEP,
    Followed,
    Leaning,
    Tolerance,
    centred,
    follow,
    redundant,
)
from rrtik_ompl.planning.tip_motion.rails import Rail
from rrtik_ompl.world.world import World

HALVINGS = 14  # halvings of a motion to find how far it is proven
LEFT = 1e-5  # [m] room left at the last configuration, so that the arm can move away again
ENDS = 8  # configurations at the end of a rail that a redundant arm tries to approach
RANDOM_REFERENCES = 6
STRONG = 5.0  # pull towards a random reference, see `Leaning`
NO_LENGTH = 1e-12  # [m] of `Way.measures`
IK_SECONDS = 1e9  # no limit of time; the rounds of inverse kinematics are limited, to some 10 ms
AT_LIMIT = 1e-3  # [rad or m] distance from a limit at which a joint counts as at its limit
CUT_OFF = 1e-6  # share of the largest singular value below which a direction counts as lost
LOST = 1e-3  # share of a twist that the joints cannot produce, above which there are too few of them
LOOKS = 16  # configurations of a motion at which contacts are looked for


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The rails that the tip is to follow, and the conditions.

    Attributes:
        rails: The rails in their order.
        tolerance: Allowed deviation from the rails.
        clearance: Clearance to keep from obstacles [m]; None for that of the world.
        seed: Seed of the random references that a redundant arm tries.
    """

    rails: tuple[Rail, ...]
    tolerance: Tolerance
    clearance: float | None
    seed: int = 0

    def clearance_in(self, world: World) -> float:
        """Return the clearance to keep from obstacles in a world [m]."""
        return world.settings.required_clearance if self.clearance is None else self.clearance

    def leads_nowhere(self, robot: Robot) -> bool:
        """Check whether the end of the rails is where they begin."""
        return bool(self.measures(robot).sum() <= NO_LENGTH)

    def measures(self, robot: Robot) -> Vector:
        """Return the measure of each rail [m], shape (rails,): its length, plus its turn times half the arm's reach."""
        per_radian = metres_per_radian(robot)
        return np.array([rail.length + per_radian * abs(rail.turn_angle) for rail in self.rails])


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """The result of one attempt.

    Attributes:
        rows: Configurations, shape (k, dof).
        proof: Their proof, or None.
        fraction: Share of the way that they cover, from 0 to 1.
        why: Tells why they end there, which may take long to find out; "" if they cover the whole way.
        attempts: Number of attempts of which this is the best.
    """

    rows: Matrix
    proof: Proof | None
    fraction: float
    why: Callable[[], str]
    attempts: int = 1

    @property
    def reason(self) -> str:
        """Why the configurations end where they do; "" if they cover the whole way."""
        return self.why()

    @property
    def length(self) -> float:
        """Length of the path in joint space [rad; metres count the same]."""
        return route_length(self.rows)


def farthest(world: World, way: Way, starts: Matrix) -> Attempt:
    """Return the attempt that comes farthest from any of some start configurations; of equal ones the shortest.

    A redundant arm that is stopped tries other ways to use its freedom.

    Args:
        world: Robot and scene.
        way: Rails and conditions.
        starts: Shape (k, dof), at least one.
    """
    best: Attempt | None = None
    attempts = 0
    for q in starts:
        for leaning in leanings(world, way, q):
            found = attempt(world, way, q, leaning)
            attempts += 1
            if best is None or (found.fraction, -found.length) > (best.fraction, -best.length):
                best = found
            if found.fraction == 1.0:
                break
        if best is not None and best.fraction == 1.0 and redundant(world.robot):
            break
    assert best is not None, "there is at least one start"
    return replace(best, attempts=attempts)


def leanings(world: World, way: Way, q: Vector) -> Iterator[Leaning]:
    """Yield ways to use the freedom that rails leave a redundant arm at q, shape (dof,), the best first.

    These are: away from the limits; no pull; towards configurations at the end of a single rail; towards random
    configurations.
    """
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
    """Follow the rails from a configuration, shape (dof,), and return the part that is proven free."""
    traced = _traced(world.robot, way, q, leaning)
    proof = _proof_of(world, way, traced.rows)
    if proof is not None and not proof.proven:
        return _proven_part(world, way, traced, proof)
    return Attempt(traced.rows, proof, traced.fraction, traced.why)


def complete(world: World, way: Way, q: Vector, ways_to_lean: Iterable[Leaning]) -> Attempt | None:
    """Follow the rails to their end in the first way that is proven free; None if there is none.

    This takes less time than :func:`attempt`, which also finds how far the arm comes.

    Args:
        world: Robot and scene.
        way: Rails and conditions.
        q: Configuration at the beginning, shape (dof,).
        ways_to_lean: What is tried, in this order.
    """
    for leaning in ways_to_lean:
        traced = _traced(world.robot, way, q, leaning)
        if traced.fraction < 1.0:
            continue
        proof = _proof_of(world, way, traced.rows)
        if proof is None or proof.proven:
            return Attempt(traced.rows, proof, traced.fraction, traced.why)
    return None


@dataclass(frozen=True, slots=True, eq=False)
class _Traced:
    """Configurations along rails, which nobody has checked.

    Attributes:
        rows: Configurations, shape (k, dof).
        shares: Share of the way at each of them, shape (k,).
        why: Tells why they end there; "" if they cover the whole way.
    """

    rows: Matrix
    shares: Vector
    why: Callable[[], str]

    @property
    def fraction(self) -> float:
        """Share of the way that they cover, from 0 to 1."""
        fraction = float(self.shares[-1])
        return 1.0 if self.why is str and fraction >= 1.0 - SMALLEST_STEP else fraction


def _traced(robot: Robot, way: Way, q: Vector, leaning: Leaning) -> _Traced:
    """Follow the rails from a configuration, shape (dof,), as far as the joints can, through obstacles too."""
    parts = [robot.clamp(q)[None]]
    places = [np.zeros(1)]
    lengths = way.measures(robot)
    total = lengths.sum()
    for number, rail in enumerate(way.rails):
        followed = follow(robot, rail, parts[-1][-1], way.tolerance, leaning)
        parts.append(followed.rows[1:])
        places.append((lengths[:number].sum() + lengths[number] * followed.shares[1:]) / total)
        if not followed.complete:
            why = partial(why_stopped, robot, rail, followed)
            return _Traced(np.concatenate(parts), np.concatenate(places), why)
    return _Traced(np.concatenate(parts), np.concatenate(places), str)


def _proof_of(world: World, way: Way, rows: Matrix) -> Proof | None:
    """Return the proof of configurations along the rails, which may be incomplete; None if there is one alone."""
    return world.prover.route(rows, clearance=way.clearance_in(world)) if len(rows) > 1 else None


def _proven_part(world: World, way: Way, traced: _Traced, proof: Proof) -> Attempt:
    """Return the part before the first place that is not proven, which is found by bisection of that motion.

    Args:
        world: Proves motions.
        way: Rails and conditions.
        traced: All configurations.
        proof: Their proof, which is incomplete.
    """
    rows = traced.rows
    shares = traced.shares
    gap = proof.unproven[0]
    a = rows[gap.motion]
    b = rows[gap.motion + 1]
    clearance = way.clearance_in(world)

    # Bisect the first motion that is not proven.
    proven_share = 0.0
    unproven_share = 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (proven_share + unproven_share)
        part = np.stack([a, a + middle * (b - a)])
        if world.prover.route(part, clearance=clearance, slack=LEFT).proven:
            proven_share = middle
        else:
            unproven_share = middle

    # Append the proven share of this motion, and prove the whole part.
    end = a + proven_share * (b - a)
    why = partial(why_blocked, world, end, b, (gap.first, gap.second))
    proven_rows = rows[: gap.motion + 1]
    fraction = float(shares[gap.motion])
    if proven_share > 0.0:
        proven_rows = np.vstack([proven_rows, end])
        fraction += proven_share * float(shares[gap.motion + 1] - shares[gap.motion])
    proven = world.prover.route(proven_rows, clearance=clearance) if len(proven_rows) > 1 else None
    return Attempt(proven_rows, proven, fraction, why)


def path_of(world: World, found: Attempt) -> JointPath | None:
    """Return the path of an attempt with its proof; None if the tip did not move."""
    if found.fraction <= 0.0:
        return None
    path = JointPath.of(world.robot, found.rows)
    return path if found.proof is None else path.with_proof(found.proof)


def why_stopped(robot: Robot, rail: Rail, followed: Followed) -> str:
    """Return why the joints cannot follow a rail any farther: joints at their limits, or a singular posture.

    Args:
        robot: The arm.
        rail: The rail.
        followed: The configurations up to where it stopped.
    """
    if len(followed.rows) >= MOST_ROWS:
        return f"the line takes more than {MOST_ROWS} configurations: allow more deviation"
    q = followed.rows[-1]
    scale = np.repeat([1.0, metres_per_radian(robot)], 3)
    plain = robot.jacobian(q)
    jacobian = plain * scale[:, None]
    twist = rail.twist(float(followed.shares[-1])) * scale

    # A joint at its limit leaves its share of the motion to others, which may then reach their limits too.
    at_limit = np.zeros(robot.dof, dtype=bool)
    while (driven_beyond := _driven_beyond_limit(robot, q, jacobian, twist, at_limit)).any():
        at_limit |= driven_beyond

    if at_limit.any():
        return _limits_in_words(robot, q, at_limit)

    values = np.linalg.svd(plain, compute_uv=False)
    lost_twist = twist - jacobian @ (np.linalg.pinv(jacobian, CUT_OFF) @ twist)
    if np.linalg.norm(lost_twist) > LOST * np.linalg.norm(twist) and len(values) < 6:
        return f"{robot.dof} joint{'s' * (robot.dof > 1)} cannot move the tip like this"
    return f"singular posture, or the end of the reach: the smallest singular value is {values[-1]:.3g}"


def why_blocked(world: World, a: Vector, b: Vector, pair: tuple[str, str]) -> str:
    """Return why a motion that is not proven free cannot be made: a contact, or two bodies too near for a proof."""
    for share in np.linspace(0.0, 1.0, LOOKS):
        q = a + share * (b - a)
        if not world.checks.free(q[None])[0]:
            return f"contact: {world.explain(q)}"
    first, second = pair
    if not first:
        return "no proof that the motion is free: two bodies that no joint moves touch"
    return f"'{first}' and '{second}' come too near to be proven apart"


def _driven_beyond_limit(robot: Robot, q: Vector, jacobian: Vector, twist: Vector, left_out: Mask) -> Mask:
    """Return which joints at a limit a motion of the tip would drive beyond it, shape (dof,).

    Args:
        robot: The arm.
        q: Shape (dof,).
        jacobian: Of the tip at q, shape (6, dof).
        twist: Wanted velocity of the tip, shape (6,), scaled like the Jacobian.
        left_out: Joints that are held in place, shape (dof,).
    """
    change = np.zeros(robot.dof)
    change[~left_out] = np.linalg.pinv(jacobian[:, ~left_out], CUT_OFF) @ twist
    low = q <= robot.lower + AT_LIMIT
    high = q >= robot.upper - AT_LIMIT
    pushed: Mask = (low & (change < 0.0)) | (high & (change > 0.0))
    return pushed & ~left_out


def _limits_in_words(robot: Robot, q: Vector, at_limit: Mask) -> str:
    """Return which joints are at a limit, and their values, in words."""
    shown = []
    for joint in np.flatnonzero(at_limit):
        factor, unit = shown_unit(robot.prismatic[joint])
        shown.append(f"'{robot.joint_names[joint]}' ({factor * q[joint]:.4g} {unit})")
    return f"limit of joint{'s' * (len(shown) > 1)} {', '.join(shown)}"
