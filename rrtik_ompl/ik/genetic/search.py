"""The genetic algorithm along a trajectory: one population follows a target that moves on whenever it is reached.

Source: [2]. The window of joint values moves with the target while the bit strings are kept. So a constant chromosome
means constant velocity (gain 0) or acceleration (gain 1), and the population predicts the next point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.ik.genetic.options import REFINED, GeneticOptions
from rrtik_ompl.ik.genetic.population import around, children, random_genes, whole_range
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.numeric.restarts import nearest_posture
from rrtik_ompl.model.goal import Target, joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits, jacobians, poses, reach_of

ENDLESS = Budget()
IMPROVEMENT = 0.99  # A cost counts as improved if it falls below this share of the best one.
MAX_ROUNDS = 64  # number of populations after which the method gives up
GENERATIONS = 40  # generations of each population; most that reach the goal do so in ten


def genetic(request: IkRequest) -> IkResponse:
    """Solve a request by one population after another, each for `GENERATIONS`; the targets take turns."""
    options = replace(REFINED, generations=GENERATIONS, stall=None, start_over=None)
    found = np.zeros((0, request.robot.dof))
    generations = 0

    for number in range(MAX_ROUNDS):
        target = request.targets[number % len(request.targets)]
        run = follow_targets(
            request.robot,
            (target,),
            options,
            request.rng,
            accept=request.accept,
            near=request.near,
            budget=request.budget,
        )
        found = np.vstack([found, run.q])
        generations += run.generations
        if len(found) and not request.all:
            return IkResponse(found, request.near, generations)
        if run.timed_out or request.budget.over():
            return _given_up(request, found, generations, timed_out=True)

    return _given_up(request, found, generations, timed_out=False)


def _given_up(request: IkRequest, found: Matrix, generations: int, *, timed_out: bool) -> IkResponse:
    """Return the response without an acceptable solution, with the configuration that comes nearest to the goal.

    If that one is at the goal but not accepted, it is added to the found ones, so that collision is the reason.
    """
    robot = request.robot
    nearest = nearest_posture(request)
    row = nearest[None]
    at_goal = row[request.goal.satisfied(robot, row) & inside_limits(robot, row)]
    return IkResponse(np.vstack([found, at_goal[~request.accept(at_goal)]]), nearest, generations, timed_out)


@dataclass(frozen=True, slots=True, eq=False)
class GeneticRun:
    """The result of a run along a trajectory.

    Attributes:
        q: Configurations of the points reached in the attempt that came farthest, shape (k, dof).
        generations: Number of generations of all attempts.
        cost_of_point: Number of generations that each of these points took, shape (k,).
        distances: Distance of the best individual of each generation from its target [m], shape (generations,).
        nearest: The configuration that came nearest to the first point not reached; that of the last point if all were.
        fresh: Number of times that the population was drawn again.
        attempts: Number of times that the trajectory was begun.
        timed_out: Whether the time limit ended the run, not the limit of generations.
    """

    q: Matrix
    generations: int
    cost_of_point: Vector
    distances: Vector
    nearest: Vector
    fresh: int
    attempts: int
    timed_out: bool


def follow_targets(
    robot: Robot,
    targets: Sequence[Target],
    options: GeneticOptions,
    rng: np.random.Generator,
    *,
    accept: Callable[[Matrix], Mask] | None = None,
    near: Vector | None = None,
    budget: Budget = ENDLESS,
) -> GeneticRun:
    """Reach one target after another until the last is reached, the generations are used up or the time is up.

    Args:
        robot: The arm.
        targets: Poses or positions, at least one.
        options: Options of the algorithm.
        rng: Source of random numbers.
        accept: Checks which configurations, shape (k, dof), are acceptable; returns shape (k,). All if None.
        near: Configuration before the first point, shape (dof,), where one individual begins; or None.
        budget: Time limit.
    """
    run = GaRun(robot, targets, options, rng, accept, near)
    while len(run.points) < len(targets) and run.generation < options.generations:
        if budget.over():
            return run.result(timed_out=True)
        run.step()
    return run.result(timed_out=False)


@dataclass(eq=False)
class GaRun:
    """The state of a run: a population, its window, the points reached so far, and counts for restarts.

    Attributes:
        robot, targets, options, rng, accept, near: See `follow_targets`.
        generation: Number of generations so far.
        attempts: Number of times that the run began at the first point.
        num_redrawn: Number of times that a population that had stalled was drawn again.
        distances: Best distance of every generation [m].
        farthest: The points of the attempt that came farthest, each of shape (dof,).
        nearest: The configuration that came nearest to the point after these, shape (dof,).
        best_cost_of_farthest: Cost of ``nearest``; infinite before there is one.
        points: The points reached in this attempt, each of shape (dof,).
        window: The joint values that the bit strings stand for.
        genes: The population, shape (population, dof).
        refined_rows: Configurations of the first individuals, if they were refined, without rounding to 16 bits; shape
            (k, dof).
        best: Best cost since the population was drawn or a point was reached; infinite before there is one.
    """

    robot: Robot
    targets: Sequence[Target]
    options: GeneticOptions
    rng: np.random.Generator
    accept: Callable[[Matrix], Mask] | None
    near: Vector | None

    def __post_init__(self) -> None:
        dimensions = 6 if self.targets[0].oriented else 3
        self.gain = float(self.robot.dof <= dimensions) if self.options.gain is None else self.options.gain

        self.generation = 0
        self.num_redrawn = 0
        self.attempts = 0
        self.distances: list[float] = []
        self.farthest: list[Vector] = []
        self.generations_by_point_of_farthest: list[int] = []
        self.nearest = self.robot.clamp(np.zeros(self.robot.dof))
        self.best_cost_of_farthest = np.inf

        self.begin()

    def begin(self) -> None:
        """Begin an attempt at the first point, with a random population in the whole range of the joints."""
        self.points: list[Vector] = []
        self.generations_by_point: list[int] = []
        self.window = whole_range(self.robot, gray=self.options.gray)
        self.attempts += 1
        self.draw()
        if self.near is not None:
            self.genes[:1] = self.window.encode(self.near[None])
        self.generations_since_point = 0

    def draw(self) -> None:
        """Draw a random population and reset the count of generations without an improvement."""
        self.genes = random_genes(self.rng, self.options.population, self.robot.dof)
        self.refined_rows = np.zeros((0, self.robot.dof))
        self.best = np.inf
        self.generations_without_gain = 0

    @property
    def last(self) -> Vector | None:
        """The configuration at the point before the one that is sought, shape (dof,), or None."""
        return self.points[-1] if self.points else self.near

    def step(self) -> None:
        """Do one generation: score the population, then move on to the next point, start again, redraw or breed."""
        Q = self.window.decode(self.genes)
        Q[: len(self.refined_rows)] = self.refined_rows
        scored = score(self.robot, self.targets[len(self.points)], Q, self.last, self.options, self.will_do)

        self.generation += 1
        self.generations_since_point += 1
        self.remember(Q, scored)

        if scored.reached.any():
            self.advance(Q[int(np.argmin(np.where(scored.reached, scored.cost, np.inf)))])
        elif self.options.start_over is not None and self.generations_since_point >= self.options.start_over:
            self.begin()
        elif self.count_stall(float(scored.cost.min())):
            self.num_redrawn += 1
            self.draw()
        else:
            self.breed(Q, scored)

    def will_do(self, Q: Matrix) -> Mask:
        """Check which configurations, shape (k, dof), are near enough to the last point and accepted; shape (k,)."""
        usable = np.ones(len(Q), dtype=bool)
        if self.options.largest_step is not None and self.points:
            usable = np.abs(joint_difference(self.robot, Q, self.points[-1])).max(axis=1) <= self.options.largest_step
        if self.accept is not None:
            usable[usable] = self.accept(Q[usable])
        return usable

    def remember(self, Q: Matrix, scored: Score) -> None:
        """Record the best distance, and the configuration that came nearest to the farthest point so far."""
        best = int(np.argmin(scored.cost))
        self.distances.append(float(scored.distance[best]))
        if len(self.points) >= len(self.farthest) and scored.cost[best] < self.best_cost_of_farthest:
            self.nearest = Q[best].copy()
            self.best_cost_of_farthest = float(scored.cost[best])

    def advance(self, q: Vector) -> None:
        """Take a configuration, shape (dof,), for the current point, and move the window for the next one.

        The window is centred at the extrapolation of the last two points; the bit strings stay as they are.
        """
        self.generations_by_point.append(self.generations_since_point)
        self.points.append(q.copy())
        self.generations_since_point = 0
        self.best = np.inf
        self.generations_without_gain = 0
        self.refined_rows = self.refined_rows[:0]

        if len(self.points) > len(self.farthest):
            self.farthest = self.points.copy()
            self.generations_by_point_of_farthest = self.generations_by_point.copy()
            self.best_cost_of_farthest = np.inf

        if self.options.window is not None:
            step = q - self.points[-2] if len(self.points) > 1 else 0.0
            max_step = np.inf if self.options.largest_step is None else self.options.largest_step
            centre = q + np.clip(self.gain * step, -max_step, max_step)
            self.window = around(self.robot, centre, self.options.window, gray=self.options.gray)

    def count_stall(self, cost: float) -> bool:
        """Compare the best cost of a generation with the best one so far.

        Returns:
            Whether there was no improvement for as many generations as the options allow.
        """
        if cost < self.best - (1.0 - IMPROVEMENT) * abs(self.best) or not np.isfinite(self.best):
            self.best = cost
            self.generations_without_gain = 0
        else:
            self.generations_without_gain += 1
        return self.options.stall is not None and self.generations_without_gain >= self.options.stall

    def breed(self, Q: Matrix, scored: Score) -> None:
        """Breed the next generation; if the options say so, the best individuals join it after a damped Newton step."""
        self.genes = children(self.rng, self.genes, scored.cost, self.options)
        if self.options.refined:
            best = np.argsort(scored.cost, kind="stable")[: self.options.refined]
            self.refined_rows, _ = descend(self.robot, self.targets[len(self.points)], Q[best], iterations=1)
            self.genes[: len(best)] = self.window.encode(self.refined_rows)

    def result(self, timed_out: bool) -> GeneticRun:
        """Return the result of the attempt that came farthest."""
        return GeneticRun(
            q=frozen(np.array(self.farthest).reshape(-1, self.robot.dof)),
            generations=self.generation,
            cost_of_point=frozen(self.generations_by_point_of_farthest),
            distances=frozen(self.distances),
            nearest=frozen(self.nearest),
            fresh=self.num_redrawn,
            attempts=self.attempts,
            timed_out=timed_out,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Scores of all individuals, shape (population,) each.

    Attributes:
        cost: The cost that selection minimises [m].
        distance: Distance from the target [m].
        angle: Angle from the target [rad].
        reached: Whether the individual is at the target and acceptable.
    """

    cost: Vector
    distance: Vector
    angle: Vector
    reached: Mask


def score(
    robot: Robot,
    target: Target,
    Q: Matrix,
    last: Vector | None,
    options: GeneticOptions,
    accept: Callable[[Matrix], Mask],
) -> Score:
    """Score configurations.

    The fitness in [2] is 100 inches less the distance; since a tournament only compares, the distance serves as well.

    Args:
        robot: The arm.
        target: A pose, or a position with any orientation.
        Q: The population, shape (m, dof).
        last: Configuration at the point before, shape (dof,), or None.
        options: The weights.
        accept: Checks which configurations are acceptable; the cost of the others is raised by the arm's reach.
    """
    tips = poses(robot, Q)
    max_distance, max_angle = target.tolerances
    distance, angle = target.tip_errors(tips)
    reached = distance < max_distance
    if target.oriented:
        reached &= angle < max_angle

    cost = distance + options.orientation_weight * angle
    if options.motion_weight and last is not None:
        cost += options.motion_weight * np.linalg.norm(joint_difference(robot, Q, last), axis=1)
    if options.singularity_weight:
        cost -= options.singularity_weight * manipulability(robot, Q, not target.oriented)

    accepted = accept(Q)
    if not accepted.all():
        reached &= accepted
        cost += reach_of(robot) * ~accepted

    return Score(cost, distance, angle, reached)


def manipulability(robot: Robot, Q: Matrix, position_only: bool) -> Vector:
    """Return the product of the Jacobian's singular values, sqrt(det(J J^T)) [31], with lengths in units of the reach.

    Args:
        robot: The arm.
        Q: Configurations, shape (m, dof).
        position_only: Whether the task is the position of the tip, not its pose.

    Returns:
        Shape (m,).
    """
    J = jacobians(robot, Q)
    J[:, :3] /= reach_of(robot)
    if position_only:
        J = J[:, :3]
    values: Vector = np.linalg.svd(J, compute_uv=False).prod(axis=1)
    return values
