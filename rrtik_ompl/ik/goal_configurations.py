"""The goal configurations of a planner: the goal's own, or free ones that inverse kinematics finds for it."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import lru_cache, partial
from weakref import WeakKeyDictionary

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, frozen
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.base.units import closest_configuration
from rrtik_ompl.constraints.held_region import held_region
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.held_tables import projected_onto
from rrtik_ompl.ik.method_interface import SAME_POSTURE
from rrtik_ompl.ik.methods import METHODS, leaves_a_curve
from rrtik_ompl.ik.multi_goals import at_all_tips
from rrtik_ompl.ik.numeric.projection import project, projected
from rrtik_ompl.ik.numeric.restarts import numeric_ik
from rrtik_ompl.ik.one_pose import solve_one_pose
from rrtik_ompl.ik.solve import DRAWS, SECONDS, solve_ik, solve_in_any_way
from rrtik_ompl.ik.targets import leaves_freedom, skip_targets, targets
from rrtik_ompl.kernels.ik.ik_layout import KERNELS, ChoiceTable
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.model.goal import GoalPart, GoalSet, Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits, poses
from rrtik_ompl.world.problem import Problem

STARTS = 48  # random configurations of one round
MAX_PARTS = 6  # parts of a grasp set that share the starts of a round, or that are looked at to explain a failure
MAX_ROUNDS = 4  # largest number of rounds to find one free configuration
LAST_ROUND = 64  # number of rounds after which no more configurations come
NO_LIMIT = 1e9  # [s]: MB-RRT then ends by the number of its passes, after some 0.1 to 0.4 s
LEAST_SECONDS = 1e-3  # time that MB-RRT gets when the time is up [s]
MAX_CONFIGURATIONS = 16  # largest number of configurations that one round adds
MAX_TOTAL = 96  # largest number of configurations altogether
SLIDES = 2  # halfway to the start and back to the goal
FARTHEST = 1e300  # [rad] or [m] of a difference, since kernels know no infinity


@dataclass(frozen=True, slots=True, eq=False)
class GoalConfigurations:
    """Free configurations at a goal.

    Attributes:
        rows: The configurations, nearest to the start first, shape (k, dof).
        reason: Why there is none, or "".
    """

    rows: Matrix
    reason: str = ""


def goal_configurations(problem: Problem, rng: np.random.Generator, *, all_turns: bool = True) -> GoalConfigurations:
    """Return free configurations that satisfy the goal of a problem: those of the first round that finds any.

    Args:
        problem: The problem.
        rng: Random numbers for the starts of inverse kinematics.
        all_turns: For a goal in joint values, whether continuous joints may also reach it the long way round.
    """
    search = GoalSearch(problem, rng, all_turns=all_turns)
    return GoalConfigurations(search.first(), search.reason)


# Results of first rounds that take all branches of a closed form and so use no random numbers: ``rows``, all
# configurations at the goal, and ``exhausted``. They are kept because a portfolio of planners, and the improvement of a
# path, search the goal of the same problem again and again.
_known_first_rounds: WeakKeyDictionary[Problem, tuple[Matrix, Matrix, bool]] = WeakKeyDictionary()


class GoalSearch:
    """A search for free configurations at the goal of a problem, which adds more of them round by round.

    The first round takes all branches of the closed form, or numeric inverse kinematics from many starts; the second
    one takes the tree of MB-RRT. Further rounds draw new targets from a goal that leaves freedom, and start again from
    random configurations. For a singular pose the branches are only samples of a curve, so further rounds follow there
    too. Results depend only on the problem and the generator.

    Attributes:
        rows: The configurations found so far, those of each round nearest to the start first, shape (k, dof).
        exhausted: Whether no more will come: all branches of the goal are known, or the largest number of rounds or
            configurations is reached.
    """

    def __init__(
        self,
        problem: Problem,
        rng: np.random.Generator | int,
        *,
        all_turns: bool = True,
        most: int = MAX_CONFIGURATIONS,
        seconds_left: Callable[[], float] = lambda: NO_LIMIT,
    ) -> None:
        """Prepare the search.

        Args:
            problem: The problem.
            rng: Source of random numbers, or a seed.
            all_turns: See :func:`goal_configurations`.
            most: Largest number of configurations that a round adds, even: half are the nearest to the start. Fewer are
                found sooner, as each is proven; all branches of a closed form are looked at in any case.
            seconds_left: Returns how much time is left [s]. :meth:`first` begins no later round when time is up, and
                MB-RRT ends with it.
        """
        self._problem = problem
        self._most = most
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

        # The results of the rounds so far.
        self._rounds = 0
        self._all_at_goal = none_yet  # configurations at the goal, in collision or not
        self._before_constraints = none_yet  # configurations at the goal, whether or not they keep path constraints
        self._first_round_is_deterministic = False  # whether the first round used no random numbers

    def first(self) -> Matrix:
        """Search for at most `MAX_ROUNDS` rounds until there is a free configuration, and return all rows."""
        for _ in range(MAX_ROUNDS):
            if len(self.rows) == 0 and (self._rounds == 0 or self._seconds_left() > 0.0):
                self.more()
        return self.rows

    def more(self) -> bool:
        """Search for one more round and add what it finds to ``rows``.

        Returns:
            Whether a new free configuration was found.
        """
        if self.exhausted:
            return False
        if self._rounds == 0 and self._problem in _known_first_rounds:
            return self._recall_first_round()

        num_known = len(self.rows)
        found = self._search_round()
        self._rounds += 1

        self._all_at_goal = np.vstack([self._all_at_goal, found])
        self.rows = frozen(np.vstack([self.rows, self._chosen(found)])[:MAX_TOTAL])
        self.exhausted |= self._rounds >= LAST_ROUND or len(self.rows) >= MAX_TOTAL

        if self._first_round_is_deterministic and self._rounds == 1 and not self._problem.constraints:
            _known_first_rounds[self._problem] = self.rows, self._all_at_goal, self.exhausted
        return len(self.rows) > num_known

    def _chosen(self, found: Matrix) -> Matrix:
        """Return the rows of ``found``, shape (m, dof), that this round adds: free, and spread out; shape (k, dof)."""
        checks = self._problem.world.checks
        free = found[checks.free(found)]
        if len(free) == 0:
            return free
        checks.prover.prepare()  # Whoever plans needs the tables soon, and without them coal would check these rows.

        if self._first_round_is_deterministic and self._rounds == 1:
            turned = _with_full_turns(self._problem, free[checks.certified(free)])
            return _spread_out(self._problem, turned, self.rows)

        # Of many rows few are chosen, and it is these that are certified.
        chosen = _spread_out(self._problem, free, self.rows, self._most)
        good = checks.certified(chosen)
        if good.all():
            return chosen
        return _spread_out(self._problem, free[checks.certified(free)], self.rows, self._most)

    def _recall_first_round(self) -> bool:
        """Take over what another search of this problem has found in its first round.

        Returns:
            Whether there is any configuration.
        """
        goal = self._problem.goal
        # The random numbers of the round are drawn all the same, so that later rounds get the same ones.
        if isinstance(goal, TipGoal):
            skip_targets(goal, DRAWS, self._rng)
            self._rng.integers(2**31)
        self._rounds = 1
        self.rows, self._all_at_goal, self.exhausted = _known_first_rounds[self._problem]
        return len(self.rows) > 0

    def _search_round(self) -> Matrix:
        """Find configurations at the goal that keep path constraints, in collision or not, shape (m, dof)."""
        world = self._problem.world
        goal = self._problem.goal
        if not isinstance(goal, TipGoal):  # a goal of several tips
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
        """Find configurations at the goal, in collision or not, by the method whose turn it is, shape (m, dof).

        The closed form is due in the first round and, for a goal with freedom, in every second one; MB-RRT in the
        second round; numeric inverse kinematics in all others and wherever these two do not fit.
        """
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
            quick = solve_one_pose(robot, goal, problem.start, True, SECONDS, seed, solve_in_any_way)
            if quick is not None:  # The pose is not singular, so these are all.
                self._first_round_is_deterministic = self.exhausted = True
                return quick.solutions
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
        found = _numeric_solutions(robot, goal, starts, round_number, rng)
        if round_number == 0 and _leaves_joints_free(robot, goal):
            return _with_nearer_ones(robot, goal, found, problem.start)
        return found

    def reason_now(self) -> Callable[[], str]:
        """Return a function that computes what `reason` is now, as it takes long; later rounds do not change it."""
        return partial(getattr, copy(self), "reason")

    @property
    def reason(self) -> str:
        """A line that says why there is no free configuration; "" if there is one, or nothing was searched yet."""
        goal = self._problem.goal
        if len(self.rows) or self._rounds == 0:
            return ""
        if len(self._all_at_goal):
            why = self._problem.world.explain(self._all_at_goal[0])
            return f"{len(self._all_at_goal)} configurations reach the goal, all in collision: for instance {why}"
        if not isinstance(goal, TipGoal):
            tips = " and ".join(f"'{frame}'" for frame in goal.frames)
            return f"goals out of reach: no configuration has {tips} at their goals"
        rounds = f"{self._rounds} round{'s' * (self._rounds != 1)}"
        if self._problem.constraints:
            fault = f"no configuration was found in {rounds} that is at the goal and keeps the path constraints"
            breach = self._smallest_breach()
            return f"{fault}; the nearest one breaks {breach}" if breach else fault
        return _explain_miss(self._problem, goal, rounds)

    def _smallest_breach(self) -> str:
        """Return how the configuration at the goal that violates path constraints least violates them, or ""."""
        constraints = self._problem.world.constraints
        if constraints is None or len(self._before_constraints) == 0:
            return ""
        amounts = [sum(sum(region.outside(q)) for region in constraints.regions) for q in self._before_constraints]
        return constraints.explain(self._before_constraints[int(np.argmin(amounts))])


def _with_long_ways(problem: Problem, q: Vector) -> Matrix:
    """Return the configuration and, for each continuous joint, the same posture with that joint a turn away.

    The turn leads to the other side of the start, so the joint moves there the other way round. Shape (k, dof).
    """
    if not has_continuous(problem.world.robot):
        return q[None]
    rows = [np.array(q)]
    for joint in np.flatnonzero(problem.world.robot.continuous):
        other = np.array(q)
        other[joint] += -TAU if other[joint] > problem.start[joint] else TAU
        rows.append(other)
    return np.array(rows)


def _with_full_turns(problem: Problem, rows: Matrix) -> Matrix:
    """Return configurations, shape (k, dof), and behind them the same postures with one joint a full turn away.

    A closed form gives each posture in the turns nearest to the start, but the way there may be blocked. Continuous
    joints are left out. Where the posture is free, it is free in every turn. Shape (m, dof).
    """
    robot = problem.world.robot
    turned = (rows[:, None] + _full_turns(robot)).reshape(-1, robot.dof)
    return np.vstack([rows, turned[inside_limits(robot, turned)]])


@kept_with
def _full_turns(robot: Robot) -> Matrix:
    """Return what a full turn of each joint that has room for one adds to a configuration, shape (k, dof)."""
    joints = robot.chain.whole_turns() & ~robot.continuous & (robot.upper - robot.lower >= TAU)
    turn = TAU * np.eye(robot.dof)[joints]
    return frozen(np.vstack([turn, -turn]))


def _move_into_regions(problem: Problem, goal: TipGoal, found: Matrix, rng: np.random.Generator) -> Matrix:
    """Return configurations at the goal of a problem that keep its path constraints.

    Configurations that keep them are returned as they are. The others, and random ones, are projected onto all regions
    of the path constraints and one part of the goal at once.

    Args:
        problem: The problem with its path constraints.
        goal: Its goal.
        found: Configurations at the goal, shape (m, dof).
        rng: Draws the random starts and the parts of the goal.

    Returns:
        Configurations at the goal that keep the constraints, shape (k, dof).
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
    """Project configurations onto all regions and one part of the goal; return those that get there."""
    try:
        aim = held_region(problem.robot, problem.world.scene, part.region(), "the goal")
    except InputError:  # The goal has ranges of angles that cannot be projected onto, so this way is closed.
        return starts[:0]
    return projected_onto(problem.robot, HeldRegions((*constraints.regions, aim)), starts)


def _method_fits(method: IkMethod, robot: Robot, drawn: list[Target]) -> bool:
    """Check whether a method fits all targets."""
    return not any(METHODS[method].misfit(robot, target) for target in drawn)


def _numeric_solutions(
    robot: Robot, goal: TipGoal, starts: Matrix, round_number: int, rng: np.random.Generator
) -> Matrix:
    """Solve for the goal by numeric inverse kinematics from given starts, shape (m, dof).

    A goal of many parts has `MAX_PARTS` of them tried in a round; these share the starts, and the parts take turns from
    round to round. Returns the configurations at the goal, shape (k, dof).
    """
    parts = goal.parts
    chosen_parts = [(round_number * MAX_PARTS + k) % len(parts) for k in range(min(len(parts), MAX_PARTS))]
    shares = np.array_split(starts, len(chosen_parts))
    found = [
        _numeric_solutions_of_part(robot, goal.alone(k), share, rng)
        for k, share in zip(chosen_parts, shares, strict=True)
    ]
    return np.vstack(found)


def _leaves_joints_free(robot: Robot, goal: TipGoal) -> bool:
    """Check whether the arm can move while its tip stays at the goal, as it has more joints than the goal needs."""
    return not goal.has_regions and robot.dof > (6 if goal.oriented else 3)


def _with_nearer_ones(robot: Robot, goal: TipGoal, found: Matrix, start: Vector) -> Matrix:
    """Return configurations at a goal that leaves joints free, shape (m, dof), and others nearer to the start.

    Half of the way towards the start and back to the goal, again and again, slides along the configurations that the
    tip allows to the one that is nearest.
    """
    rows = [found]
    moved = found
    for _ in range(SLIDES):
        away = np.linalg.norm(weighted_difference(robot, moved, start), axis=1)
        nearest = moved[np.argsort(away, kind="stable")[:MAX_CONFIGURATIONS]]
        moved = numeric_ik(robot, goal, robot.clamp(nearest - 0.5 * joint_difference(robot, nearest, start)))
        rows.append(moved)
    return np.vstack(rows)


def _numeric_solutions_of_part(robot: Robot, goal: TipGoal, starts: Matrix, rng: np.random.Generator) -> Matrix:
    """Solve for a goal of one part by numeric inverse kinematics; return configurations at it, shape (k, dof).

    For a region, half of the starts are projected onto random places in it, since the others end on its rim.
    """
    if not goal.has_regions:
        return numeric_ik(robot, goal, starts)
    (part,) = goal.parts
    rows = projected(robot, part.region(), starts, rng)
    return rows[part.satisfied(robot, rows)]


def _spread_out(problem: Problem, rows: Matrix, known: Matrix, most: int = MAX_CONFIGURATIONS) -> Matrix:
    """Choose at most `most` rows that differ from each other and from the known ones.

    The first half are those nearest to the start. Each of the others is the one farthest from all chosen so far, since
    configurations near to each other may all be blocked by the same obstacle.

    Args:
        problem: The problem, which gives the start.
        rows: Configurations to choose from, shape (m, dof).
        known: Configurations that are known already, shape (k, dof).
        most: Largest number of rows.

    Returns:
        The chosen rows with continuous joints turned near to the start, nearest to the start first.
    """
    robot = problem.world.robot
    from_start = joint_difference(robot, rows, problem.start)
    turned = np.where(robot.continuous, problem.start + from_start, rows)
    distance = np.linalg.norm(weighted_difference(robot, rows, problem.start), axis=1)
    separation = np.full(len(rows), np.inf)  # largest joint difference from the nearest known or chosen row
    for row in known:
        separation = np.minimum(separation, np.abs(joint_difference(robot, turned, row)).max(axis=1))

    chosen = _apart(robot, turned, distance, separation, most)
    return turned[sorted(chosen, key=lambda k: (distance[k], k))]


def _apart(robot: Robot, rows: Matrix, away: Vector, separation: Vector, most: int) -> list[int]:
    """Return the indices of the rows that `_spread_out` chooses, by a kernel or in numpy.

    Args:
        robot: The arm.
        rows: Configurations, shape (m, dof).
        away: Their distances from the start, shape (m,).
        separation: The largest joint difference of each from the nearest that is known, shape (m,).
        most: Largest number of them.
    """
    chosen: list[int] = []
    kernels = library(KERNELS)
    if kernels is not None and len(rows):
        choice = ChoiceTable(PlannedTable(_choice_plan(len(rows), robot.dof, most)))
        choice.q[:] = rows.ravel()
        choice.away[:] = away
        choice.apart[:] = np.minimum(separation, FARTHEST)
        choice.endless.view(np.int32)[: robot.dof] = robot.continuous
        count = kernels.choose_apart(choice.address)
        chosen = choice.chosen.view(np.int32)[:count].tolist()
        return chosen

    while len(chosen) < most and (separation > SAME_POSTURE).any():
        is_first_half = len(chosen) < most // 2
        score = -away if is_first_half else separation
        best = int(np.argmax(np.where(separation > SAME_POSTURE, score, -np.inf)))
        chosen.append(best)
        separation = np.minimum(separation, np.abs(joint_difference(robot, rows, rows[best])).max(axis=1))
    return chosen


@lru_cache(maxsize=64)
def _choice_plan(rows: int, dof: int, most: int) -> TablePlan:
    """Return the memory layout of a choice of at most so many among configurations; cached."""
    return sizes_of(
        ChoiceTable,
        q=rows * dof,
        away=rows,
        apart=rows,
        endless=dof,
        chosen=most,
        rows=rows,
        dof=dof,
        most=most,
        least=SAME_POSTURE,
    )


def _explain_miss(problem: Problem, goal: TipGoal, rounds: str) -> str:
    """Return a line that says how near the arm came to a goal within its limits, in so many rounds."""
    robot = problem.world.robot
    regions = [part.region() for part in goal.parts]
    starts = np.random.default_rng(0).uniform(*robot.finite_range(), (STARTS, robot.dof))
    # Projecting onto each of thousands of parts would take minutes, so the nearest ones by position are taken.
    if len(regions) > MAX_PARTS:
        places = np.array([(region.T_world_w * region.T_w_tip).translation for region in regions])
        distances = np.linalg.norm(places[:, None] - poses(robot, starts)[:, :3, 3], axis=2).min(axis=1)
        regions = [regions[k] for k in np.argsort(distances, kind="stable")[:MAX_PARTS]]
        goal = GoalSet(regions)

    starts = starts[: STARTS // len(regions)]
    ends = np.vstack([project(robot, region, starts) for region in regions])
    distance, angle = goal.errors(robot, ends)
    best = np.argmin(goal.distance(robot, ends))

    if goal.satisfied(robot, ends[best : best + 1])[0]:
        return f"inverse kinematics found no configuration at the goal in {rounds}; another seed may find one"
    closest = closest_configuration(distance[best], angle[best] if goal.oriented else 0.0)
    return f"goal out of reach: {closest}"
