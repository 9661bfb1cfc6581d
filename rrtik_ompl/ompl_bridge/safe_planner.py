"""The base class of array planners: it handles OMPL's objects, so that a planner only sees arrays.

OMPL's Python bindings return borrowed C++ objects that must not outlive their owner, and an exception that leaves
``solve`` ends a whole benchmark. This class therefore keeps C++ objects in local variables, copies states to arrays at
once, and always returns a status from ``solve``.
"""

from __future__ import annotations

import inspect
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial, wraps
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, whole_number
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.ompl_bridge.bindings import ob, ou
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.motion_checker import MotionChecker, SpaceChecker, WorldChecker
from rrtik_ompl.ompl_bridge.planner_inputs import condition_of, starts_and_goals, usable
from rrtik_ompl.ompl_bridge.results import (
    Failure,
    IllPosed,
    LaterTree,
    PlannerGraph,
    SearchResult,
    Tree,
    explained,
    failure_of,
    graph_of_path,
    graph_of_trees,
    nearest_approach,
    status_of,
)
from rrtik_ompl.ompl_bridge.states import StateIO, coordinates_of
from rrtik_ompl.ompl_bridge.unrolled import Unrolled
from rrtik_ompl.world.motion_queries import MotionQueries, turning_joints
from rrtik_ompl.world.route_check import route_violations, verification_resolution
from rrtik_ompl.world.world import World, form_of

SEARCHES = 20  # limit of the searches until the second check of a world accepts a path
FILLED_IN = ("world", "seed", "goal")  # options that `plan()` fills in
GIVEN = "_given"  # the attribute that keeps the arguments of a planner's constructor


class SafePlanner(ob.Planner):  # type: ignore[misc]  # OMPL has no types
    """Base class of planners: a subclass implements :meth:`search` on arrays and is a complete ``ompl.base.Planner``.

    Every ``solve`` is a new attempt from the starts and goals of the problem definition; nothing is kept from an
    earlier one except the state of the random generator. ``solve`` never raises an Exception: it returns ``CRASH`` and
    keeps the text in :attr:`error`. KeyboardInterrupt and SystemExit pass. `plan()` calls :meth:`solve_rows`, which
    does the same without OMPL's states and goals.

    A planner refuses options by an InputError, from its constructor or, if it depends on starts and goals, from
    :meth:`search`. The options are the keyword parameters of the constructor; `plan()` fills in ``world``, ``seed``
    and, for planners that have this parameter, ``goal``.

    The traits of the class, which `plan()` reads, are explained at
    :class:`~rrtik_ompl.ompl_bridge.planner_traits.PlannerTraits`; a class with ``supports_iteration_limit`` has the
    option ``max_iterations``.

    Attributes:
        seed: The seed in use; given, or drawn from OMPL's generator, so that ``ompl.util.RNG.setSeed`` fixes it too.
        rng: The random generator for :meth:`search`.
        statistics: Counts of the last ``solve``, plain ints and floats.
        error: Why the last ``solve`` was impossible or broke, with the traceback if it broke; else None.
        failure: Why the last ``solve`` broke, or None.
        reason: Why the last ``solve`` found no path, if the search could say it; else "".
        progress: Pairs of a time since the last ``solve`` began [s] and the length of the best path at that time.
        graph_wanted: For :meth:`search`: whether the graph can be asked for afterwards.

    Example:
        >>> class Direct(rrtik.ompl.SafePlanner):
        ...     def __init__(self, si, *, world=None, seed=None):
        ...         super().__init__(si, "Direct", world=world, seed=seed)
        ...
        ...     def search(self, starts, goals, checker, ptc):
        ...         free = checker.motion_valid(starts[0], goals[0])
        ...         return rrtik.ompl.SearchResult(np.array([starts[0], goals[0]]) if free else None)
        >>> problem = rrtik.Problem(rrtik.World(rrtik.load_robot("planar3")), [0.0, 0.0, 0.0], [1.0, 0.5, 0.0])
        >>> rrtik.plan(problem, Direct, seed=1).found
        True
    """

    anytime: ClassVar[bool] = False
    one_goal: ClassVar[bool] = False
    finds_goals: ClassVar[bool] = False
    straight_first: ClassVar[bool] = False
    supports_iteration_limit: ClassVar[bool] = False
    path_statistics: ClassVar[tuple[str, ...]] = ()
    kernels: ClassVar[tuple[str, ...]] = ()
    one_joint: ClassVar[bool] = False
    brief_options: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    proof_iterations: ClassVar[int] = 0
    keeps_constraints: ClassVar[bool] = False

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__init__" in vars(cls):
            cls.__init__ = remembering(vars(cls)["__init__"])  # type: ignore[method-assign]

    def __init__(
        self, si: ob.SpaceInformation, name: str, *, world: MotionQueries | None = None, seed: int | None = None
    ) -> None:
        """Make a planner.

        Args:
            si: ``ompl.base.SpaceInformation`` of a RealVectorStateSpace, an SO2StateSpace or a compound of them.
            name: Name for OMPL's reports.
            world: If given, it checks configurations and motions instead of ``si``.
            seed: At least 0; None draws one from OMPL's generator.

        Raises:
            InputError: If the space is of another kind or the seed is no such number.
        """
        coordinates_of(si)  # raises an error for other spaces
        used = int(ou.RNG().uniformInt(0, 2**31 - 1)) if seed is None else whole_number(seed, "seed")
        super().__init__(si, name)
        self.seed = used
        self.statistics: dict[str, int | float] = {}
        self.error: str | None = None
        self.failure: Failure | None = None
        self.reason = ""
        self.progress: tuple[tuple[float, float], ...] = ()
        self.graph_wanted = False
        self._rng: np.random.Generator | None = None
        self._graph: PlannerGraph | Callable[[], PlannerGraph] | None = None  # made when it is asked for
        self._world = world
        self._second_check_world: World | None = None  # during `solve` a path has to pass its second check
        self._states: StateIO | None = None
        self._bounds: tuple[Vector, Vector] | None = None

    @property
    def rng(self) -> np.random.Generator:
        """The random generator; made when it is first used, because that takes as long as an easy search."""
        if self._rng is None:
            self._rng = np.random.default_rng(self.seed)
        return self._rng

    def reseed(self, seed: int) -> None:
        """Give the planner another seed, so that it acts as one made with it, if it has the trait ``reseeded``."""
        self.seed = seed
        self._rng = None

    @classmethod
    def default_options(cls) -> dict[str, Any]:
        """Return the options of the planner with their defaults."""
        return {name: default for name, default in keyword_parameters(cls).items() if name not in FILLED_IN}

    def set(self, name: str, value: object) -> None:
        """Change an option by its name in the constructor; a text such as "0.3" is read as a number.

        Raises:
            InputError: If there is no such option, or the planner refuses the value; the option then keeps its old
                value.
        """
        change(self, name, value)

    def parameters(self) -> dict[str, Any]:
        """Return the options with their values, as :meth:`set` takes them.

        None stands for a value that suits the problem.
        """
        return options_of(self)

    def graph(self) -> PlannerGraph:
        """Return the graph of the last ``solve`` by OMPL: vertices, edges that were found free, and their costs.

        For a planner that keeps no tree this is its path; `plan()` keeps no graph.

        Raises:
            PlannerError: If there is no graph, because nothing was solved since the planner was made or cleared.
        """
        if self._graph is None:
            raise PlannerError(f"{self.getName()}: there is no graph; use planner.solve(), or solve of a SimpleSetup")
        if not isinstance(self._graph, PlannerGraph):
            self._graph = self._graph()
        return self._graph

    def kept_graph(self) -> PlannerGraph | None:
        """Return the graph of the last ``solve``; None if there is none, as the planner keeps no tree."""
        return None if self._graph is None else self.graph()

    def grown(
        self, starts: Callable[[], Tree | LaterTree], goals: Callable[[], Tree | LaterTree] | None = None
    ) -> Callable[[], PlannerGraph] | None:
        """Return the graph of trees for the result of :meth:`search`; None if no graph is wanted. For subclasses.

        Args:
            starts: Returns the tree from the starts, which must not change any more, or a function that makes it;
                only called if the graph is wanted.
            goals: Returns the tree from the goals, if there is one.
        """
        if not self.graph_wanted:
            return None
        return partial(graph_of_trees, starts(), None if goals is None else goals())

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Search for a path from any start to any goal until ``ptc()`` is true. Implemented by subclasses.

        Args:
            starts: Free configurations, shape (s, n), s at least 1.
            goals: Free configurations, shape (g, n), g at least 1, or 0 if :meth:`needs_goals` returns False.
            checker: Checks configurations and motions.
            ptc: Returns True when it is time to stop.
        """
        raise NotImplementedError(f"{type(self).__name__} has no search()")

    def needs_goals(self) -> bool:
        """Check whether the search needs goal configurations; overridden by subclasses that do not.

        ``solve`` asks this of a planner object, so the answer may depend on its options. The trait ``finds_goals``
        belongs to the class: `plan()` reads it before there is a planner.
        """
        return True

    def solve(
        self, ptc: ob.PlannerTerminationCondition | Callable[[], object] | float, interval: float = 0.0
    ) -> ob.PlannerStatus:
        """Solve the problem of the problem definition; called by OMPL.

        Args:
            ptc: ``PlannerTerminationCondition``, a function that returns True when it is time to stop, or a time in
                seconds.
            interval: How often a thread of OMPL would call the function. Not used: the search itself calls it, because
                an exception in that thread would end the process.

        Returns:
            ``ompl.base.PlannerStatus``.
        """
        self.graph_wanted = True
        status, _ = self._run_search(lambda: self._in_ompl(condition_of(ptc)))
        return ob.PlannerStatus(status)

    def solve_rows(
        self,
        starts: Matrix,
        goals: Matrix,
        bounds: tuple[Vector, Vector],
        stop: Stop,
        *,
        checked: bool = False,
        keep_graph: bool = False,
    ) -> tuple[ob.PlannerStatus, Matrix | None]:
        """Solve as :meth:`solve` does, in the planner's world, without OMPL's states and goals.

        Args:
            starts: Configurations inside the bounds, shape (s, n).
            goals: Configurations inside the bounds, shape (g, n); none are needed if :meth:`needs_goals` returns False.
            bounds: Finite lower and upper bounds of the planner's space, shapes (n,).
            stop: Returns True when it is time to stop.
            checked: Whether starts and goals are known to be free.
            keep_graph: Whether :meth:`kept_graph` can be asked for afterwards.

        Returns:
            The status, and the path, shape (k, n), if there is an exact one.
        """
        self._bounds = bounds
        self.graph_wanted = keep_graph
        status, found = self._run_search(
            lambda: self._search_between_free_ends(starts, goals, stop, known_free=checked)
        )
        if found is None:
            return ob.PlannerStatus(status), None
        if keep_graph:
            self._graph = found.graph
        is_exact = found.difference <= 0.0
        return ob.PlannerStatus(status), found.path if is_exact else None

    def clear(self) -> None:
        """Forget the last attempt; called by OMPL."""
        super().clear()
        self._forget()

    def ends_free(self, rows: Matrix, checker: MotionChecker) -> Mask:
        """Check which starts and goals, shape (m, n), are free, shape (m,).

        Subclasses with a faster check override it.
        """
        return checker.valid_batch(rows)

    def stands(self, rows: Matrix, checker: MotionChecker) -> bool:
        """Check whether a path, shape (k, n), is free, also by the second check of a world.

        For subclasses that improve a path. `plan()` makes the second check itself, for the last path.
        """
        motions_are_free = bool(checker.motion_valid_batch(rows[:-1], rows[1:]).all())
        return motions_are_free and not _refusal_of_second_check(self._second_check_world, rows)

    def bounds(self) -> tuple[Vector, Vector]:
        """Return lower and upper bounds, shapes (n,), read-only, as they were when ``solve`` was last called.

        Angles of SO(2) are unrolled onto a line: their bounds are a turn below and a turn above the first start.
        """
        return self._io.bounds() if self._bounds is None else self._bounds

    def turning(self) -> Mask | None:
        """Return which coordinates turn, shape (n,): joints of the world's arm, or angles of SO(2).

        None if that is unknown.
        """
        joints = turning_joints(self._world)
        return self._io.turning if joints is None and self._io.turns else joints

    @property
    def _io(self) -> StateIO:
        """The converter between states and arrays, made when it is first used."""
        if self._states is None:
            self._states = StateIO(self.getSpaceInformation())  # it holds the space, which does not refer to planners
        return self._states

    def _run_search(self, search: Callable[[], SearchResult]) -> tuple[ob.PlannerStatus, SearchResult | None]:
        """Run a search, and record why it was impossible or broke.

        Returns:
            OMPL's status, and the result of the search; None if it was impossible or broke.
        """
        self._forget()
        try:
            found = search()
        except IllPosed as refused:
            if refused.status == ob.PlannerStatus.TIMEOUT:
                self.reason = refused.reason
            else:
                self.error = refused.reason
            return refused.status, None
        except Exception as error:
            self.failure = failure_of(error)
            self.error = explained(error)
            return ob.PlannerStatus.CRASH, None
        return status_of(found), found

    def _forget(self) -> None:
        """Reset all attributes that describe the last ``solve``."""
        self.statistics = {}
        self.error = None
        self.failure = None
        self.reason = ""
        self.progress = ()
        self._graph = None

    def _in_ompl(self, ptc: Stop) -> SearchResult:
        """Search between the starts and goals of the problem definition, and add the path to it."""
        si = self.getSpaceInformation()
        pdef = self.getProblemDefinition()
        if pdef is None:
            raise PlannerError(f"{self.getName()}: no problem definition; use SimpleSetup or setProblemDefinition()")

        self._bounds = self._io.bounds()  # missing bounds are refused in clearer words than OMPL's
        if self._world is None and not si.isSetup():
            si.setup()  # before setup, checkMotion only checks the end point

        inputs = self.getPlannerInputStates()
        aimless = not self.needs_goals()
        began = time.perf_counter()
        ends = starts_and_goals(inputs, pdef, self._io, ptc, aimless=aimless)

        # Angles of SO(2) are unrolled onto a line for the time of the search.
        unrolled = Unrolled(*ends, self._io.turning) if self._io.turns else None
        if unrolled is not None:
            ends = (unrolled.starts, unrolled.goals)
            self._bounds = unrolled.bounds(*self._bounds)

        # Search, and fall back on the nearest approach to a goal if there is no path.
        found = self._search_until_accepted(*ends, ptc, unrolled)
        if found.path is None and isinstance(pdef.getGoal(), GoalSampler):
            pdef.getGoal().more()  # the next attempt has more goal configurations
        found = self._remember(found, ends[1], time.perf_counter() - began)

        # An approximate path has not been checked yet.
        is_approximate = found.difference > 0.0
        if is_approximate and _refusal_of_second_check(self._world, found.path, unrolled):
            found = replace(found, path=None)
        if found.path is not None:
            path = self._io.path(si, found.path if unrolled is None else unrolled.path(found.path))
            pdef.addSolutionPath(path, is_approximate, float(found.difference), self.getName())

        return found

    def _search_until_accepted(
        self, starts: Matrix, goals: Matrix, stop: Stop, unrolled: Unrolled | None
    ) -> SearchResult:
        """Search, and search again as long as the second check of a given world refuses the path.

        From the second search on, and for anytime planners from the first on, motions are checked as densely as by the
        second check.

        Args:
            starts: Shape (s, n).
            goals: Shape (g, n).
            stop: Returns True when it is time to stop.
            unrolled: Divides a path for the second check, if the space has angles of SO(2).
        """
        world = self._world
        if not isinstance(world, World):  # without a world there is no second check
            return self._search_between_free_ends(starts, goals, stop)

        self._second_check_world = world
        try:
            for number in range(SEARCHES):
                if number == (0 if self.anytime else 1):
                    self._world = form_of(world, motion_resolution=verification_resolution(world.settings))
                found = self._search_between_free_ends(starts, goals, stop)
                refusal = _refusal_of_second_check(world, found.path, unrolled)
                if not refusal or stop():
                    break
        finally:
            self._world = world
            self._second_check_world = None

        if not refusal:
            return found

        self.reason = f"no path stood: {refusal}"
        return replace(found, path=None, difference=0.0, reason=self.reason)

    def _remember(self, found: SearchResult, goals: Matrix, seconds: float) -> SearchResult:
        """Record the graph and the progress of a search.

        Args:
            found: The result of the search.
            goals: Shape (g, n).
            seconds: Time of the search [s].

        Returns:
            The result of the search; without a path, the nearest approach to a goal in the graph takes its place, if
            any.
        """
        if found.path is None:
            self._graph = found.graph
            approach = None if found.graph is None or len(goals) == 0 else nearest_approach(self.graph(), goals)
            return found if approach is None else replace(found, path=approach[0], difference=approach[1])

        self._graph = found.graph or partial(graph_of_path, found.path)
        if found.difference <= 0.0:
            self.progress = found.progress or ((seconds, route_length(found.path)),)
        return found

    def _search_between_free_ends(
        self, starts: Matrix, goals: Matrix, stop: Stop, *, known_free: bool = False
    ) -> SearchResult:
        """Search between those starts and goals, shapes (s, n) and (g, n), that are free."""
        checker = SpaceChecker(self.getSpaceInformation()) if self._world is None else WorldChecker(self._world)
        ends_are_free = known_free and len(goals) > 0 and self.needs_goals()
        ends = (starts, goals) if ends_are_free else self._free_ends(starts, goals, checker)

        found = self.search(*ends, checker, stop)
        checked = {"checked_states": checker.checked_states, "checked_motions": checker.checked_motions}
        self.statistics = {**found.statistics, **checked}
        self.reason = found.reason
        return found

    def _free_ends(self, starts: Matrix, goals: Matrix, checker: MotionChecker) -> tuple[Matrix, Matrix]:
        """Return the free starts and, if needed, the free goals, at least one of each."""
        if not self.needs_goals():
            return usable(starts, None, checker.valid_batch(starts))
        # All are checked in one call, because a call costs more than a check.
        free = self.ends_free(np.concatenate([starts, goals]), checker)
        return usable(starts, goals, free)


def _refusal_of_second_check(world: object, rows: Matrix | None, unrolled: Unrolled | None = None) -> str:
    """Return why a world's second check refuses a path, shape (k, n), in a line; "" if it accepts it.

    A missing path is not refused.
    """
    if rows is None or not isinstance(world, World):
        return ""
    if unrolled is not None:
        rows = unrolled.divided(rows)
    if len(rows) == 1:
        rows = rows.repeat(2, axis=0)  # a motion of no length
    found = route_violations(world.checks, rows, verification_resolution(world.settings))
    return found[0].reason if found else ""


def keyword_parameters(planner: Callable[..., Any]) -> Mapping[str, Any]:
    """Return the parameters of a planner's class with their defaults, without the first one, the space information."""
    # A separate function, because lru_cache requires Hashable arguments and mypy does not count classes as such.
    return _parameters(planner)


def remembering(constructor: Callable[..., None]) -> Callable[..., None]:
    """Wrap a constructor so that it stores the options it is given.

    If constructors call each other, the options of the outermost one are stored.
    """

    @wraps(constructor)
    def remember(self: object, *arguments: Any, **options: Any) -> None:
        self.__dict__.setdefault(GIVEN, options)
        constructor(self, *arguments, **options)

    return remember


def options_of(planner: ob.Planner) -> dict[str, Any]:
    """Return the options of a planner with the values in use."""
    defaults = {name: value for name, value in keyword_parameters(type(planner)).items() if name not in FILLED_IN}
    given = planner.__dict__.get(GIVEN, {})
    return {name: given.get(name, value) for name, value in defaults.items()}


def change(planner: ob.Planner, name: str, value: object) -> None:
    """Change an option of a planner as if it had been given to its constructor; a text is read as JSON if possible.

    Raises:
        UnknownNameError: If there is no option of that name.
        InputError: If the planner refuses the value; the option then keeps its old value.
    """
    options = options_of(planner)
    if name not in options:
        raise UnknownNameError(f"parameter of planner {planner.getName()}", name, tuple(options))

    given = {**planner.__dict__[GIVEN], name: _read(value)}
    try:
        made = type(planner)(planner.getSpaceInformation(), **{**given, "seed": planner.seed})
    except TypeError as error:
        raise InputError(f"planner {planner.getName()}: {name}: {error}") from None

    # Take over everything that depends on options, but neither the state of the random generator nor objects of the
    # space.
    settings = {key: each for key, each in vars(made).items() if key not in ("_rng", "_states")}
    planner.__dict__.update(settings)
    planner.__dict__[GIVEN] = given


def _read(value: object) -> object:
    """Return the value that a text spells: None, a boolean or anything in JSON; keep other values."""
    if not isinstance(value, str):
        return value
    words = {"none": None, "true": True, "false": False}
    if value.strip().lower() in words:
        return words[value.strip().lower()]

    try:
        return json.loads(value)
    except ValueError:
        return value


@lru_cache(maxsize=64)
def _parameters(planner: Callable[..., Any]) -> Mapping[str, Any]:
    parameters = list(inspect.signature(planner).parameters.values())[1:]
    return MappingProxyType({each.name: each.default for each in parameters})
