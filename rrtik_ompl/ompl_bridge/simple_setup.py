"""A world or a problem for users' own OMPL code: a SpaceInformation or a SimpleSetup."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from typing import Any

from ompl import base as ob
from ompl import geometric as og

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, ProofWarning, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.ownership import foreign_code
from rrtik_ompl.ompl_bridge.planner_traits import OMPL_TRAITS, PlannerTraits
from rrtik_ompl.ompl_bridge.region_constraint import projected_space
from rrtik_ompl.ompl_bridge.setup import CheckedMotions, bounded_space, circular_space
from rrtik_ompl.ompl_bridge.states import Coordinates, StateIO, coordinates_of
from rrtik_ompl.world.problem import Problem, fixed_ends, planning_bounds, refuse_covered_goal
from rrtik_ompl.world.proven_edges import ProvenEdges
from rrtik_ompl.world.route_check import motion_taken
from rrtik_ompl.world.world import World

FAR = 1e3  # [m] clearance for OMPL where nothing can collide; its reports cannot hold infinity

TIP_PROJECTION = "tip"  # name of a projection of the space


class WorldValidity(ob.StateValidityChecker):  # type: ignore[misc]  # OMPL has no types
    """Checks validity and clearance of states by a world.

    An exception must not pass through OMPL's second thread (PRM), as it would end the process; a configuration that the
    world refuses to check counts as invalid.
    """

    def __init__(self, si: ob.SpaceInformation, world: World, edges: ProvenEdges) -> None:
        super().__init__(si)
        self._world = world
        self._valid = edges.valid
        self._states = StateIO(si)

    def isValid(self, state: ob.State) -> bool:
        """Check whether a state is inside the limits and free; called by OMPL."""
        return self._valid(self._states.read(state))

    def clearance(self, state: ob.State) -> float:
        """Return the smallest signed distance of the arm from obstacles and itself less margins [m]; called by OMPL."""
        nearest = self._world.clearance(self._states.read(state))
        return nearest if math.isfinite(nearest) else FAR


class TipProjection(ob.ProjectionEvaluator):  # type: ignore[misc]  # OMPL has no types
    """Projects a configuration to the position of the tip, for planners that keep a grid (such as KPIECE1).

    OMPL chooses the size of the cells from samples. It must not hold the space, which holds it; otherwise neither is
    freed.
    """

    def __init__(self, space: ob.StateSpace, robot: Robot, coordinates: Coordinates) -> None:
        super().__init__(space)
        self._robot = robot
        self._coordinates = coordinates

    def getDimension(self) -> int:
        """Return the dimension of the projection, three; called by OMPL."""
        return 3

    def project(self, state: ob.State, projection: Vector) -> None:
        """Write the position of the tip [m] into ``projection``, shape (3,); called by OMPL."""
        projection[:] = self._robot.fk_batch([self._coordinates.read(state)])[0, :3, 3]


class ProblemSetup(og.SimpleSetup):  # type: ignore[misc]  # OMPL has no types
    """A SimpleSetup that works around limitations of OMPL's planners and bindings."""

    def solve(self, *limit: Any, **named: Any) -> ob.PlannerStatus:
        """Solve as OMPL's own method does, within seconds or until a termination condition.

        PRM, PRMstar, BFMT and AORRTC get the first goal configuration alone, as in `plan()`: PRM collects further goals
        in a thread of its own, which waits for Python forever; BFMT can crash; AORRTC gives up. AORRTC and SORRTstar go
        straight where that is free: there the one's path begins at the goal, and the other does not look at the time.
        For planners written in Python and derived from ``ompl.base.Planner``, states are protected from being freed
        twice.

        Raises:
            InputError: If PRM is to minimise an objective that is written in Python, for which it would wait as well,
                or if the planner does not know the space.
        """
        try:
            return self._solve(*limit, **named)
        except RuntimeError as error:
            if "only supports" not in str(error):
                raise
            message = f"{self.getPlanner().getName()}: it does not know this space: {error}"
            raise InputError(f"{message.rstrip('.')}; leave so2 out, or use another planner") from None

    def _solve(self, *limit: Any, **named: Any) -> ob.PlannerStatus:
        self.setup()  # also makes the default planner if none is set
        planner = self.getPlanner()
        definition = self.getProblemDefinition()
        with bearable(planner, definition), foreign_code(planner, definition):
            if _traits(planner).straight_first and _add_straight_path(definition, planner.getName()):
                return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)
            return super().solve(*limit, **named)


def _traits(planner: ob.Planner) -> PlannerTraits:
    """Return the traits of a planner of OMPL; the default ones for any other planner."""
    return OMPL_TRAITS.get(type(planner), PlannerTraits())


def _add_straight_path(definition: ob.ProblemDefinition, name: str) -> bool:
    """Add the straight path from the first start to the first goal to a problem, if it is free.

    Args:
        definition: The problem.
        name: Name of the planner that is said to have found it.
    """
    si = definition.getSpaceInformation()
    inputs = ob.PlannerInputStates()
    inputs.use(definition)
    start = inputs.nextStart() if inputs.haveMoreStartStates() else None
    goal = inputs.nextGoal() if isinstance(definition.getGoal(), ob.GoalSampleableRegion) else None
    free = start is not None and goal is not None and bool(si.checkMotion(start, goal))
    if free:
        definition.addSolutionPath(og.PathGeometric(si, start, goal), False, 0.0, name)
    return free


def bearable(planner: ob.Planner, definition: ob.ProblemDefinition) -> AbstractContextManager[None]:
    """Return a context inside which a planner of OMPL has the first goal alone, if it cannot bear several.

    Raises:
        InputError: If PRM is to minimise an objective that is written in Python.
    """
    if isinstance(planner, og.PRM):
        _refuse_python(planner.getName(), definition.getOptimizationObjective())
    return first_goal_alone(definition) if _traits(planner).one_goal else nullcontext()


def _refuse_python(name: str, objective: ob.OptimizationObjective | None) -> None:
    if objective is not None and type(objective).__module__.partition(".")[0] != "ompl":
        raise InputError(
            f"{name}: its second thread would wait for ever for {type(objective).__name__}, which is written in "
            "Python; use an objective of OMPL's, or another planner, such as BITstar"
        )


@contextmanager
def first_goal_alone(definition: ob.ProblemDefinition) -> Iterator[None]:
    """Replace the goal of a problem by its first configuration inside a ``with`` block, if it can be sampled."""
    goal = definition.getGoal()
    si = definition.getSpaceInformation()
    inputs = ob.PlannerInputStates()
    inputs.use(definition)
    state = inputs.nextGoal() if isinstance(goal, ob.GoalSampleableRegion) else None
    if state is None:
        yield
        return

    first = ob.GoalStates(si)
    first.addState(state)  # copied
    del state
    definition.setGoal(first)

    try:
        yield
    finally:
        definition.setGoal(goal)


def space_information(
    world_or_problem: World | Problem, *, so2: bool = False, proven: bool = True
) -> ob.SpaceInformation:
    """Return a set-up ``ompl.base.SpaceInformation`` over the joints of an arm, with the checks of a world.

    Its space is a RealVectorStateSpace within the joint limits [rad; m]; a joint without limits gets a turn on both
    sides of the start of a problem, or half a turn on both sides of 0 for a world. States are checked by the world, and
    a motion counts as free only if it is proven free for its whole length, so that parts into which OMPL cuts it are
    free as well. A motion that grazes something can be neither proven nor refuted, and is refused. The validity checker
    also computes the clearance, so that OMPL's reports of it are right. In addition to OMPL's own projection the space
    has "tip", the position of the tip. For a problem with path constraints the result is a ConstrainedSpaceInformation
    of a ProjectedStateSpace, for planners of OMPL.

    Args:
        world_or_problem: A `World`, or a `Problem`, whose world is used.
        so2: Whether a joint without limits becomes an SO2StateSpace, in which whole turns do not change the posture.
            The space is then a CompoundStateSpace with the joints in their order, and "tip" is its default projection.
        proven: Whether motions have to be proven. Otherwise those that cannot be are checked in steps of half the
            motion resolution; parts of such a motion, checked at other places, may be refused.

    Raises:
        InputError: If it is neither, or SO(2) is wanted along path constraints.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> si = rrtik.ompl.space_information(rrtik.World(rrtik.load_robot("titan4")))
        >>> si.getStateDimension()
        6
    """
    require(so2, bool, "so2")
    require(proven, bool, "proven")
    if isinstance(world_or_problem, World):
        return _information(world_or_problem, *world_or_problem.robot.finite_range(), so2, proven)
    if not isinstance(world_or_problem, Problem):
        raise InputError(f"space_information: expected a World or a Problem, got {type(world_or_problem).__name__}")

    q = world_or_problem.goal.q
    ends = world_or_problem.start[None] if q is None else q[None]
    bounds = planning_bounds(world_or_problem, ends)

    if not world_or_problem.constraints:
        return _information(world_or_problem.world, *bounds, so2, proven)
    if so2:
        raise InputError("space_information: a problem with path constraints has no space with SO(2); leave so2 out")
    unheld = world_or_problem.world.unheld
    motion_valid = ProvenEdges(unheld).motion_valid if proven else unheld.motion_valid
    si = projected_space(world_or_problem, *bounds, motion_valid)
    return _judged(si, world_or_problem.world, ProvenEdges(world_or_problem.world))


def simple_setup(problem: Problem, *, seed: int | None = 0, so2: bool = False, proven: bool = True) -> og.SimpleSetup:
    """Return a problem as ``ompl.geometric.SimpleSetup``: space, checks, start and goal; only the planner is missing.

    A goal in joint values becomes a GoalState, any other goal a :class:`~rrtik_ompl.ompl_bridge.GoalSampler`. Its
    ``solve`` gives planners that cannot handle several goals the first one (:meth:`ProblemSetup.solve`).

    Args:
        problem: The problem to plan.
        seed: Seed of the search for configurations at a goal of the tip; None draws one.
        so2: See :func:`space_information`.
        proven: See :func:`space_information`. A warning tells if the start or the goal cannot be proven free.

    Raises:
        InputError: If it is no problem, or SO(2) is wanted along path constraints.
        ProblemError: If an obstacle that moves covers the goal now.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> from ompl import geometric as og
        >>> setup = rrtik.ompl.simple_setup(rrtik.load_problem("titan4_sdu"))
        >>> setup.setPlanner(og.RRTConnect(setup.getSpaceInformation()))
    """
    if not isinstance(problem, Problem):
        raise InputError(f"simple_setup: expected a Problem, got {type(problem).__name__}")
    refuse_covered_goal(problem)

    si = space_information(problem, so2=so2, proven=proven)
    if proven:
        _warn_of_unproven(problem)
    setup = ProblemSetup(si)
    states = StateIO(si)
    state = si.allocState()

    states.write(state, problem.start)
    setup.addStartState(state)

    goal: ob.Goal
    if problem.goal.q is not None:
        goal = ob.GoalState(si)
        states.write(state, problem.goal.q)
        goal.setState(state)
    else:
        goal = GoalSampler(problem, si, seed=seed)

    setup.setGoal(goal)
    return setup


def _warn_of_unproven(problem: Problem) -> None:
    """Warn of a start or goal that is not proven free, at which planners would give up without a word."""
    world = problem.world.unheld
    for what, q in fixed_ends(problem).items():
        if gaps := world.prover.route(q[None], clearance=world.settings.required_clearance).unproven:
            pair = f"'{gaps[0].first}' and '{gaps[0].second}' are too near"
            message = f"simple_setup: the {what} is not proven free ({pair}), so each motion there will be refused"
            warnings.warn(ProofWarning(f"{message}; proven=False checks motions in steps"), stacklevel=3)


def _information(world: World, lower: Vector, upper: Vector, so2: bool, proven: bool) -> ob.SpaceInformation:
    """Return a SpaceInformation within bounds, shapes (n,), whose states and motions a world checks."""
    endless = world.robot.continuous
    si = circular_space(lower, upper, endless) if so2 and endless.any() else bounded_space(lower, upper)
    edges = ProvenEdges(world)
    if proven:
        si.setMotionValidator(CheckedMotions(si, edges.motion_valid, edges.motion_valid_batch))
    else:
        si.setMotionValidator(CheckedMotions(si, partial(_taken, world)))
    return _judged(si, world, edges)


def _taken(world: World, a: Vector, b: Vector) -> bool:
    """Check whether a motion is free in steps and by the second check; with the checks of the calling thread."""
    return motion_taken(world.checks, a, b)


def _judged(si: ob.SpaceInformation, world: World, edges: ProvenEdges) -> ob.SpaceInformation:
    """Set up a SpaceInformation in place with checks of states by a world and the projection "tip", and return it."""
    si.setStateValidityChecker(WorldValidity(si, world, edges))
    space = si.getStateSpace()
    if isinstance(si, ob.ConstrainedSpaceInformation):
        si.setup()  # before setup the space would lose the projection

    tip = TipProjection(space, world.robot, coordinates_of(si, constrained=True))
    space.registerProjection(TIP_PROJECTION, tip)
    if space.isCompound():  # a compound has none of its own, which KPIECE1 needs
        space.registerDefaultProjection(tip)

    if not si.isSetup():
        si.setup()
    return si
