"""Which configurations a planner may aim at: the goal's own, or free ones that inverse kinematics finds for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, frozen
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.held_region import held_region
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.held_tables import projected_onto
from rrtik_ompl.ik.method_interface import SAME_POSTURE
from rrtik_ompl.ik.methods import METHODS, leaves_a_curve
from rrtik_ompl.ik.multi_goals import at_all_tips
from rrtik_ompl.ik.numeric.projection import project, projected
from rrtik_ompl.ik.numeric.restarts import numeric_ik
from rrtik_ompl.ik.solve import DRAWS, solve_ik
from rrtik_ompl.ik.targets import leaves_freedom, skip_targets, targets
from rrtik_ompl.model.goal import GoalPart, GoalSet, Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.robot import Robot, poses
from rrtik_ompl.world.problem import Problem

STARTS = 48  # random postures of one round
MAX_PARTS = (
    6  # of a grasp set, among which the starts of a round are shared out, or to which it is said how near it came
)
MAX_ROUNDS = 4  # at most, until one free configuration is found
LAST_ROUND = 64  # after which no more configurations come
NO_LIMIT = 1e9  # [s]; the passes of MB-RRT are counted, some 0.1 to 0.4 s of them
LEAST_SECONDS = 1e-3  # [s] of MB-RRT when the time is up
MAX_CONFIGURATIONS = 16  # configurations that one round adds
MAX_TOTAL = 96  # configurations altogether


@dataclass(frozen=True, slots=True, eq=False)
class GoalConfigurations:
    """Free configurations at the goal, nearest to the start first, shape (k, dof); if there is none, the reason."""

    rows: Matrix
    reason: str = ""


def goal_configurations(problem: Problem, rng: np.random.Generator, *, all_turns: bool = True) -> GoalConfigurations:
    """Free configurations that satisfy the goal of a problem: those of the first round that finds any.

    Args:
        problem: The problem.
        rng: Random numbers for the starts of inverse kinematics.
        all_turns: For a goal in joint values: whether continuous joints may also reach it the long way round.
    """
    search = GoalSearch(problem, rng, all_turns=all_turns)
    return GoalConfigurations(search.first(), search.reason)


# First rounds that take all branches of a closed form, in which nothing is random: rows, all that was found, and
# whether that is all there is. A portfolio, and a path that is being improved, ask for them plan after plan.
_known_first_rounds: WeakKeyDictionary[Problem, tuple[Matrix, Matrix, bool]] = WeakKeyDictionary()


class GoalSearch:
    """Free configurations at the goal of a problem, more of them round after round, the same for the same generator.

    The first round takes all branches of the analytic solver, or numeric inverse kinematics from many starts; the
    second the tree of MB-RRT; further ones draw further targets from a goal that leaves freedom, and start anew from
    random postures. Of a singular pose the branches are but members of a curve, so that further rounds follow too.

    Attributes:
        rows: Those found so far, each round's nearest to the start first, shape (k, dof).
        exhausted: Whether no more will come: all branches of the goal are known, or the limits are reached of rounds
            and configurations.
    """

    def __init__(
        self,
        problem: Problem,
        rng: np.random.Generator | int,
        *,
        all_turns: bool = True,
        seconds_left: Callable[[], float] = lambda: NO_LIMIT,
    ) -> None:
        """Prepare the search; see :func:`goal_configurations`. A seed will do for a generator.

        ``seconds_left`` says how long there is time: a later round begins only then, and MB-RRT ends with it.
        """
        self._problem = problem
        self._seconds_left = seconds_left
        none_yet: Matrix = frozen(np.zeros((0, problem.world.robot.dof)))

        q = problem.goal.q
        if q is not None:
            self.rows: Matrix = frozen(_with_long_ways(problem, q) if all_turns else q[None])
            self.exhausted = True
        else:
            self.rows = none_yet
            self.exhausted = False
            self._rng = np.random.default_rng(rng)

        # what has come of the rounds so far
        self._rounds = 0
        self._all_at_goal = none_yet  # in collision or not
        self._before_constraints = none_yet  # at the goal, whether or not they keep path constraints
        self._first_round_is_deterministic = False  # nothing random was in it

    def first(self) -> Matrix:
        """Search until there is a free configuration, for a few rounds; all rows."""
        for _ in range(MAX_ROUNDS):
            if len(self.rows) == 0 and (self._rounds == 0 or self._seconds_left() > 0.0):
                self.more()
        return self.rows

    def more(self) -> bool:
        """Search for one round more.

        Returns:
            Whether it found a free configuration that is new.
        """
        if self.exhausted:
            return False
        if self._rounds == 0 and self._problem in _known_first_rounds:
            return self._recall_first_round()

        num_known = len(self.rows)
        found = self._search_round()
        self._rounds += 1

        checks = self._problem.world.checks
        free = found[checks.free(found)]
        free = free[checks.certified(free)]
        self._all_at_goal = np.vstack([self._all_at_goal, found])
        self.rows = frozen(np.vstack([self.rows, _spread_out(self._problem, free, self.rows)])[:MAX_TOTAL])
        self.exhausted |= self._rounds >= LAST_ROUND or len(self.rows) >= MAX_TOTAL

        if self._first_round_is_deterministic and self._rounds == 1 and not self._problem.constraints:
            _known_first_rounds[self._problem] = self.rows, self._all_at_goal, self.exhausted
        return len(self.rows) > num_known

    def _recall_first_round(self) -> bool:
        """Take what another search of this problem has found in its first round.

        Returns:
            Whether that is any.
        """
        goal = self._problem.goal
        if isinstance(goal, TipGoal):  # the random numbers that the round would draw: later ones stay the same
            skip_targets(goal, DRAWS, self._rng)
            self._rng.integers(2**31)
        self._rounds = 1
        self.rows, self._all_at_goal, self.exhausted = _known_first_rounds[self._problem]
        return len(self.rows) > 0

    def _search_round(self) -> Matrix:
        """Configurations at the goal that keep path constraints, in collision or not, by one round, shape (m, dof)."""
        world = self._problem.world
        goal = self._problem.goal
        if not isinstance(goal, TipGoal):  # of several tips
            regions = () if world.constraints is None else world.constraints.regions
            return at_all_tips(
                world.robot, goal, self._problem.start, self._rng, scene=world.scene, path_regions=regions
            )

        found = self._solve_ik_round(goal)
        if self._problem.constraints:
            self._before_constraints = np.vstack([self._before_constraints, found])
            found = _move_into_regions(self._problem, goal, found, self._rng)
        return found

    def _solve_ik_round(self, goal: TipGoal) -> Matrix:
        """Configurations at the goal, in collision or not, by the method whose turn it is, shape (m, dof)."""
        problem = self._problem
        rng = self._rng
        round_number = self._rounds
        robot = problem.world.robot
        parts = goal.parts
        drawn_targets = targets(goal, DRAWS, rng)
        seed = int(rng.integers(2**31))
        goal_leaves_freedom = any(leaves_freedom(part) for part in parts)

        other_branches_may_come = goal_leaves_freedom and round_number % 2 == 0
        closed_form_is_due = round_number == 0 or other_branches_may_come
        if closed_form_is_due and _method_fits("closed-form", robot, drawn_targets):
            self._first_round_is_deterministic = not goal_leaves_freedom and len(parts) <= DRAWS
            self.exhausted = self._first_round_is_deterministic and not leaves_a_curve(robot, drawn_targets)
            return solve_ik(robot, goal, method="closed-form", near=problem.start, all=True, seed=seed).solutions

        if round_number == 1 and _method_fits("mb-rrt", robot, drawn_targets):
            seconds_left = max(self._seconds_left(), LEAST_SECONDS)
            return solve_ik(
                robot, goal, method="mb-rrt", near=problem.start, world=problem.world, seconds=seconds_left, seed=seed
            ).solutions

        starts = rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
        starts[0] = problem.start
        return _numeric_solutions(robot, goal, starts, round_number, rng)

    @property
    def reason(self) -> str:
        """Why there is no free configuration, in a line; "" if there is one."""
        goal = self._problem.goal
        if len(self.rows):
            return ""
        if len(self._all_at_goal):
            why = self._problem.world.explain(self._all_at_goal[0])
            return f"{len(self._all_at_goal)} configurations reach the goal, all in collision: for instance {why}"
        if not isinstance(goal, TipGoal):
            tips = " and ".join(f"'{frame}'" for frame in goal.frames)
            return f"no configuration with {tips} at their goals was found in {self._rounds} rounds; are they in reach?"
        rounds = f"{self._rounds} round{'s' * (self._rounds != 1)}"
        if self._problem.constraints:
            fault = f"no configuration was found in {rounds} that is at the goal and keeps the path constraints"
            breach = self._smallest_breach()
            return f"{fault}; the nearest one breaks {breach}" if breach else fault
        return (
            f"inverse kinematics found no configuration at the goal in {rounds}; {_explain_miss(self._problem, goal)}"
        )

    def _smallest_breach(self) -> str:
        """Which path constraint the configuration at the goal breaks that breaks them least, and by how much."""
        constraints = self._problem.world.constraints
        if constraints is None or len(self._before_constraints) == 0:
            return ""
        amounts = [sum(sum(region.outside(q)) for region in constraints.regions) for q in self._before_constraints]
        return constraints.explain(self._before_constraints[int(np.argmin(amounts))])


def _with_long_ways(problem: Problem, q: Vector) -> Matrix:
    """The configuration and, for each continuous joint, the same posture reached the other way round."""
    if not has_continuous(problem.world.robot):
        return q[None]
    rows = [np.array(q)]
    for joint in np.flatnonzero(problem.world.robot.continuous):
        other = np.array(q)
        other[joint] += -TAU if other[joint] > problem.start[joint] else TAU
        rows.append(other)
    return np.array(rows)


def _move_into_regions(problem: Problem, goal: TipGoal, found: Matrix, rng: np.random.Generator) -> Matrix:
    """Configurations at the goal of a problem that keep its path constraints.

    Args:
        problem: With path constraints.
        goal: Its goal.
        found: Configurations at the goal, shape (m, dof). Those that are outside a region are moved into all, along
            what the goal leaves free.
        rng: Draws further starts.

    Returns:
        Shape (k, dof).
    """
    constraints = problem.world.constraints
    if constraints is None:
        return found

    keeps_constraints = constraints.held(found)
    starts = np.vstack(
        [found[~keeps_constraints], rng.uniform(*problem.robot.finite_range(), (STARTS, problem.robot.dof))]
    )
    rows = [found[keeps_constraints]]
    if not keeps_constraints.all() or len(found) == 0:
        parts = goal.parts
        chosen = rng.permutation(len(parts))[:MAX_PARTS]
        rows += [_move_into_regions_and_part(problem, constraints, parts[k], starts) for k in chosen]

    joined: Matrix = np.vstack(rows)
    return joined[goal.satisfied(problem.robot, joined)] if len(joined) else joined


def _move_into_regions_and_part(problem: Problem, constraints: HeldRegions, part: GoalPart, starts: Matrix) -> Matrix:
    """Configurations moved into all regions and to one part of the goal; those that get there."""
    try:
        aim = held_region(problem.robot, problem.world.scene, part.region(), "the goal")
    except InputError:  # ranges of angles that cannot be held; inverse kinematics alone must do
        return starts[:0]
    return projected_onto(problem.robot, HeldRegions((*constraints.regions, aim)), starts)


def _method_fits(method: IkMethod, robot: Robot, drawn: list[Target]) -> bool:
    """Whether a method can solve for all targets."""
    return not any(METHODS[method].misfit(robot, target) for target in drawn)


def _numeric_solutions(
    robot: Robot, goal: TipGoal, starts: Matrix, round_number: int, rng: np.random.Generator
) -> Matrix:
    """Configurations at the goal to which numeric inverse kinematics leads; of many parts some take turns."""
    parts = goal.parts
    chosen_parts = [(round_number * MAX_PARTS + k) % len(parts) for k in range(min(len(parts), MAX_PARTS))]
    shares = np.array_split(starts, len(chosen_parts))
    found = [
        _numeric_solutions_of_part(robot, goal.alone(k), share, rng)
        for k, share in zip(chosen_parts, shares, strict=True)
    ]
    return np.vstack(found)


def _numeric_solutions_of_part(robot: Robot, goal: TipGoal, starts: Matrix, rng: np.random.Generator) -> Matrix:
    """The same for one part alone. Walks end on the rim of ranges, so that these are projected onto, spread out."""
    if not goal.has_regions:
        return numeric_ik(robot, goal, starts)
    (part,) = goal.parts
    rows = projected(robot, part.region(), starts, rng)
    return rows[part.satisfied(robot, rows)]


def _spread_out(problem: Problem, rows: Matrix, known: Matrix) -> Matrix:
    """At most `MAX_CONFIGURATIONS` rows unlike each other and the known, turned near the start, nearest first.

    Half of them are the nearest to the start; the others lie farthest from all that were chosen before, for what is
    near to the start and to each other may all be blocked by the same thing.
    """
    robot = problem.world.robot
    from_start = joint_difference(robot, rows, problem.start)
    turned = np.where(robot.continuous, problem.start + from_start, rows)
    distance = np.linalg.norm(weighted_difference(robot, rows, problem.start), axis=1)
    separation = np.full(len(rows), np.inf)  # largest joint difference from the nearest of those chosen
    for row in known:
        separation = np.minimum(separation, np.abs(joint_difference(robot, turned, row)).max(axis=1))

    chosen: list[int] = []
    while len(chosen) < MAX_CONFIGURATIONS and (separation > SAME_POSTURE).any():
        is_first_half = len(chosen) < MAX_CONFIGURATIONS // 2
        score = -distance if is_first_half else separation
        best = int(np.argmax(np.where(separation > SAME_POSTURE, score, -np.inf)))
        chosen.append(best)
        separation = np.minimum(separation, np.abs(joint_difference(robot, turned, turned[best])).max(axis=1))
    return turned[sorted(chosen, key=lambda k: (distance[k], k))]


def _explain_miss(problem: Problem, goal: TipGoal) -> str:
    """How near the arm came to a goal within its limits, in a line."""
    robot = problem.world.robot
    regions = [part.region() for part in goal.parts]
    starts = np.random.default_rng(0).uniform(*robot.finite_range(), (STARTS, robot.dof))
    if len(regions) > MAX_PARTS:  # to walk to each of thousands would take minutes
        places = np.array([(region.T_world_w * region.T_w_tip).translation for region in regions])
        distances = np.linalg.norm(places[:, None] - poses(robot, starts)[:, :3, 3], axis=2).min(axis=1)
        regions = [regions[k] for k in np.argsort(distances, kind="stable")[:MAX_PARTS]]
        goal = GoalSet(regions)

    starts = starts[: STARTS // len(regions)]
    ends = np.vstack([project(robot, region, starts) for region in regions])
    distance, angle = goal.errors(robot, ends)
    best = np.argmin(goal.distance(robot, ends))

    if goal.satisfied(robot, ends[best : best + 1])[0]:
        return "walks from other starts do reach it, so that another seed may find one"
    miss = f"{1e3 * distance[best]:.1f} mm and {np.degrees(angle[best]):.1f} degrees"
    return f"the nearest one misses it by {miss}; is it in reach?"
