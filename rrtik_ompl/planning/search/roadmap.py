"""Roadmaps of a world: made once, queried many times, saved to files, checked again when an obstacle moves."""

from __future__ import annotations

import os
import time
from functools import partial
from io import BytesIO
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, filled_rows, finite_array, positive, seed_of, whole_number
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.errors import InputError, called, in_file, require
from rrtik_ompl.files import notice
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.text import known_ending, write_bytes
from rrtik_ompl.geometry.collision.digests import robot_digest, world_digest
from rrtik_ompl.kernels.search.roadmap.graph import KernelGraph
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, KERNELS, UNKNOWN
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.planning.search.roadmap_in_python import PythonGraph
from rrtik_ompl.world.motion_queries import MotionQueries, decider, has_kernels, keeps_constraints
from rrtik_ompl.world.problem import usable_configurations
from rrtik_ompl.world.world import World

VERTICES = 2000  # vertices of a new roadmap
NEAR = 10  # near vertices with which a new one is joined
MANY_IN_NUMPY = 200  # vertices that take some tenths of a second each in numpy
SECONDS = 60.0  # [s] limit for making a roadmap in a world where next to nothing is free
MOST_VERTICES = 1_000_000
FORMAT = 1
NOT_PROVING = -1.0  # stored in place of the clearance of proofs [m]


class Graph(Protocol):
    """A roadmap without a world: a :class:`KernelGraph` or a :class:`PythonGraph`."""

    @property
    def size(self) -> int:
        """Number of vertices."""

    @property
    def rows(self) -> Matrix:
        """The vertices, shape (size, n)."""

    @property
    def edges(self) -> NDArray[np.int32]:
        """Pairs of vertices, shape (m, 2)."""

    @property
    def states(self) -> NDArray[np.int32]:
        """State of each edge, shape (m,): UNKNOWN, SURE or BLOCKED."""

    def restore(self, rows: Matrix, edges: NDArray[np.int32], states: NDArray[np.int32]) -> None:
        """Fill an empty graph with the vertices, edges and states of another one."""

    def grow(self, wanted: int, stop: Stop) -> int:
        """Add up to ``wanted`` free samples, and return how many were added."""

    def learn(self, path: Matrix) -> int:
        """Add the waypoints of a free path, shape (k, n), as vertices, and return how many."""

    def check(self, stop: Stop) -> None:
        """Check all edges whose state is unknown."""

    def route(self, starts: Matrix, goals: Matrix, stop: Stop) -> Matrix | None:
        """Return the shortest path on the graph from a start to a goal, shape (k, n), or None."""

    def statistics(self) -> dict[str, int | float]:
        """Return counts of vertices, edges, checked motions and samples."""


def checked_near(near: object) -> int:
    """Return the checked number of near vertices with which a new vertex is joined.

    Raises:
        InputError: If it is none of 1 to 100.
    """
    if not 1 <= (count := whole_number(near, "near")) <= 100:
        raise InputError(f"near must be from 1 to 100, got {near}")
    return count


def graph_in(
    world: MotionQueries | None, lower: Vector, upper: Vector, *, near: int, seed: int, checks: MotionQueries
) -> Graph:
    """Return an empty graph in a box of configurations: in kernels if the world has them, else in Python.

    Args:
        world: The world; None for the graph in Python.
        lower: Lower bounds of the box, shape (n,).
        upper: Upper bounds of the box, shape (n,).
        near: With how many near vertices a new one is joined.
        seed: Seed of the samples.
        checks: Answers the checks that the kernels cannot decide, or all of them.
    """
    if not has_kernels(world, KERNELS):
        return PythonGraph(lower, upper, near=near, seed=seed, valid=checks.valid, motion_free=checks.motion_valid)
    ask = decider(world, checks.motion_valid_batch)
    # The kernels only accept configurations inside the limits.
    lower = np.maximum(lower, world.robot.lower)
    upper = np.minimum(upper, world.robot.upper)
    return KernelGraph(world.motions, lower, upper, near=near, seed=seed, ask=ask)


class Roadmap:
    """A roadmap of a world: free configurations joined by free motions, for any number of queries.

    A query joins its start and goal with the vertices near them and searches for the shortest path on the roadmap,
    which takes about a tenth of a millisecond. Its motions are checked in steps. `plan()` with the planner "roadmap"
    also proves them, and adds a path of RRT-Connect where the roadmap has none. A roadmap must not be used by several
    threads at once.

    Attributes:
        world: The world of the roadmap.
        seed: Seed of its samples.
        near: With how many of the vertices near it a new vertex is joined.

    Args:
        world: Robot and scene.
        vertices: Number of free configurations to begin with; there are fewer if they are not found within a minute.
        seed: The same seed gives the same roadmap; None draws one.
        near: With how many of the vertices near it a new vertex is joined, from 1 to 100.

    Raises:
        InputError: If a number makes no sense, or the world has path constraints, which a roadmap does not keep.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> problem = rrtik.load_problem("titan4_prisms")
        >>> roadmap = rrtik.Roadmap(problem.world)
        >>> roadmap.path(problem.start, problem.goal.q).start.tolist() == problem.start.tolist()
        True
        >>> rrtik.plan(problem, "roadmap", parameters={"roadmap": roadmap}).found
        True
    """

    def __init__(self, world: World, *, vertices: int = VERTICES, seed: int | None = 0, near: int = NEAR) -> None:
        require(world, World, "world of a roadmap", "use World(robot, scene)")
        if not 0 <= whole_number(vertices, "vertices") <= MOST_VERTICES:
            raise InputError(f"vertices must be {MOST_VERTICES} or less, got {vertices}")
        # Random samples do not satisfy path constraints, and files do not store them.
        if keeps_constraints(world):
            raise InputError("world of a roadmap: it has path constraints, which a roadmap does not keep; use cbirrt")

        self.near = checked_near(near)
        self.world = world
        self.seed = seed_of(seed)
        self.graph = graph_in(world, *_box(world.robot), near=near, seed=self.seed, checks=world)
        self.grow(vertices)

    def __repr__(self) -> str:
        return f"Roadmap({self.world.robot.name}, {self.graph.size} vertices, {len(self.graph.states)} edges)"

    def __reduce__(self) -> tuple[Any, ...]:
        parts = (self.world, self.graph.rows, self.graph.edges, self.graph.states)
        return partial(_restored, seed=self.seed, near=self.near), parts

    @property
    def vertices(self) -> Matrix:
        """The configurations, shape (n, dof)."""
        return self.graph.rows

    @property
    def edges(self) -> NDArray[np.int32]:
        """Pairs of vertices whose motions are not known to be blocked, shape (m, 2)."""
        edges: NDArray[np.int32] = self.graph.edges[self.graph.states != BLOCKED]
        return edges

    def grow(self, vertices: int, *, seconds: float = SECONDS) -> int:
        """Add vertices and check their edges, for at most ``seconds``; return how many vertices were added."""
        vertices = whole_number(vertices, "vertices")
        if vertices > MANY_IN_NUMPY and not has_kernels(self.world, KERNELS):
            notice.warn_of_minutes(f"{vertices} vertices of a roadmap")
        deadline = time.perf_counter() + positive(seconds, "seconds")
        added = self.graph.grow(vertices, lambda: time.perf_counter() > deadline)
        self.graph.check(lambda: time.perf_counter() > deadline)
        return added

    def path(self, start: ArrayLike, goal: ArrayLike | Goal, *, seconds: float = 1.0) -> JointPath | None:
        """Return the shortest path on the roadmap between two configurations, its motions checked in steps.

        Args:
            start: Shape (dof,) [rad or m].
            goal: Shape (dof,) [rad or m], or a joint goal.
            seconds: Wall time after which to give up [s].

        Returns:
            The path, or None if the roadmap has none; `plan()` with the planner "roadmap" then adds one.

        Raises:
            ProblemError: If start or goal is not free.
            InputError: If one of them is no configuration of the robot.
        """
        end = goal.q if isinstance(goal, Goal) else goal
        if end is None:
            raise InputError(f"goal of a roadmap: expected a configuration, got a {type(goal).__name__}; use solve_ik")
        ends = usable_configurations(self.world, {"start": start, "goal": end})
        deadline = time.perf_counter() + positive(seconds, "seconds")
        rows = self.route(ends["start"][None], ends["goal"][None], lambda: time.perf_counter() > deadline)
        return None if rows is None else JointPath.of(self.world.robot, rows)

    def route(self, starts: Matrix, goals: Matrix, stop: Stop) -> Matrix | None:
        """Return the shortest path between free configurations as waypoints, shape (k, dof), or None.

        Joints without limits are shifted by whole turns, so that the first start lies in the box of the roadmap.

        Args:
            starts: Shape (s, dof).
            goals: Shape (g, dof).
            stop: Returns True to give up.
        """
        called(stop, "stop of a roadmap")
        starts, goals = (filled_rows(rows, self.world.robot.dof, "ends of a route") for rows in (starts, goals))
        turns = self._turns(starts[0])
        if not turns.any():
            return self.graph.route(starts, goals, stop)
        rows = self.graph.route(starts - turns, goals - turns, stop)
        if rows is None:
            return None

        rows = rows + turns
        # Shifting by turns has rounded the ends, so they are replaced by the given ones.
        first = _nearest(starts, rows[0])
        last = _nearest(goals, rows[-1])
        rows[0] = first
        rows[-1] = last
        return rows

    def learn(self, path: Matrix) -> None:
        """Add the part of a free path, shape (k, dof), that lies in the box of the roadmap."""
        rows = filled_rows(path, self.world.robot.dof, "path to learn")
        self.graph.learn(rows - self._turns(rows[0]))

    def _turns(self, start: Vector) -> Vector:
        """Return the whole turns of joints without limits between the roadmap and a configuration [rad]."""
        turns: Vector = np.where(self.world.robot.continuous, np.rint(start / TAU) * TAU, 0.0)
        return turns

    def moved_to(self, world: World) -> Roadmap:
        """Return the same roadmap in another world of the robot, for instance after an obstacle has moved.

        Its vertices are checked at once, and edges of vertices that are not free are left out. The motions of the other
        edges are checked again when a query needs them. This roadmap stays as it is.

        Raises:
            InputError: If the world is of another robot or has path constraints.
        """
        require(world, World, "world of a roadmap", "use World(robot, scene)")
        if robot_digest(world.robot) != robot_digest(self.world.robot):
            raise InputError(f"roadmap of robot '{self.world.robot.name}': the world is of another robot")

        rows = self.graph.rows
        edges = self.graph.edges
        free = world.valid_batch(rows) if len(rows) else np.zeros(0, dtype=bool)
        states = np.where(free[edges].all(axis=1), UNKNOWN, BLOCKED).astype(np.int32)
        return _restored(world, rows, edges, states, seed=self.seed, near=self.near)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the roadmap as .npz file; if writing fails, no incomplete file is left.

        Raises:
            InputError: If the ending is another one or the file cannot be written.
        """
        known_ending(file, (".npz",), "file of a roadmap")
        data = BytesIO()
        world = self.world
        numbers = {"format": FORMAT, "seed": self.seed, "near": self.near, "resolution": world.motion_resolution}
        names = {"robot": world.robot.name, "digest": world_digest(world.robot, world.bodies, world.pairs)}
        graph = {"rows": self.graph.rows, "edges": self.graph.edges, "states": self.graph.states.astype(np.int8)}
        everything: dict[str, Any] = {**numbers, "kept": _clearances_of(world), **names, **graph}
        np.savez_compressed(data, **everything)
        write_bytes(file, data.getvalue())

    @staticmethod
    def load(file: str | os.PathLike[str], world: World, *, moved: bool = False) -> Roadmap:
        """Read a roadmap that was saved.

        Args:
            file: A .npz file.
            world: The world of the roadmap.
            moved: Whether the world may be another one of the same robot; if so, everything is checked again as by
                :meth:`moved_to`.

        Raises:
            InputError: If the file cannot be used or is of another world, or this one has path constraints.

        Example:
            >>> world = rrtik.World(rrtik.load_robot("planar3"))
            >>> rrtik.Roadmap(world, seed=1).save("map.npz")
            >>> rrtik.Roadmap.load("map.npz", world).world is world
            True
        """
        return read(Roadmap, file, world, moved=moved)


def read_roadmap(file: str | os.PathLike[str], world: World, *, moved: bool = False) -> Roadmap:
    """Read a roadmap; see :meth:`Roadmap.load`.

    Raises:
        InputError: If the file cannot be used or is of another world, or this one has path constraints.
    """
    known_ending(file, (".npz",), "file of a roadmap")
    require(world, World, "world of a roadmap", "use World(robot, scene)")
    data = NamedArrays(file)
    try:
        if (version := data.count("format")) != FORMAT:
            raise InputError(f"its format is {version}, not {FORMAT}")
        if (name := str(data["robot"])) != world.robot.name:
            raise InputError(f"it is of robot '{name}'")
        digest = str(data["digest"])
        seed = data.count("seed")
        near = data.count("near")
        rows = finite_array(data["rows"], (None, world.robot.dof), "vertices")
        edges = data.whole_numbers("edges")
        states = data.whole_numbers("states")
        if not 1 <= near <= 100 or not _fit(edges, states, len(rows)):
            raise InputError("its edges make no sense")
        clearances = finite_array(data["kept"], (2,), "kept").tolist() if "kept" in data else [0.0, NOT_PROVING]
        same_checks = positive(
            data["resolution"], "resolution"
        ) == world.motion_resolution and clearances == _clearances_of(world)
    except InputError as error:
        raise InputError(f"{file}: is no roadmap of robot '{world.robot.name}': {error}") from error

    # The states of the edges only hold in the same world with the same checks; otherwise they are checked again.
    known = edges.astype(np.int32), states.astype(np.int32)
    found = world_digest(world.robot, world.bodies, world.pairs)
    if moved is not True and digest != found:
        raise InputError(f"{file}: is the roadmap of another world; load it with moved=True, or make a new one")
    try:
        roadmap = _restored(world, rows, *known, seed=seed, near=near)
    except InputError as error:
        raise in_file(file, error) from error
    return roadmap if digest == found and same_checks else roadmap.moved_to(world)


def _fit(edges: NDArray[np.int64], states: NDArray[np.int64], count: int) -> bool:
    """Check whether edges and their states belong to a graph of ``count`` vertices."""
    if edges.ndim != 2 or edges.shape[1] != 2 or states.shape != (len(edges),):
        return False
    if not len(edges):
        return True
    return bool(0 <= edges.min() <= edges.max() < count and 0 <= states.min() <= states.max() <= BLOCKED)


def _clearances_of(world: World) -> list[float]:
    """Return the clearance that free motions of a world keep, and that of its proofs or `NOT_PROVING` [m]."""
    proving = world.settings.proving
    return [world.settings.clearance + world.settings.inflation, NOT_PROVING if proving is None else proving]


def _restored(
    world: World, rows: Matrix, edges: NDArray[np.int32], states: NDArray[np.int32], *, seed: int, near: int
) -> Roadmap:
    """Return a roadmap with the graph of another one; samples that are added later are different ones."""
    roadmap = Roadmap(world, vertices=0, seed=seed, near=near)
    roadmap.graph = graph_in(world, *_box(world.robot), near=near, seed=seed + len(rows), checks=world)
    roadmap.graph.restore(rows, edges, states)
    return roadmap


def _box(robot: Robot) -> tuple[Vector, Vector]:
    """Return the bounds of the vertices, shapes (dof,): the limits, or a turn either way of 0 if there are none."""
    return np.where(robot.continuous, -TAU, robot.lower), np.where(robot.continuous, TAU, robot.upper)


def _nearest(rows: Matrix, row: Vector) -> Vector:
    """Return the row that is nearest to another one, shape (dof,)."""
    nearest: Vector = rows[np.linalg.norm(rows - row, axis=1).argmin()]
    return nearest
