"""Results of a planner's search: path, counts and graph; and the reason why a ``solve`` was impossible."""

from __future__ import annotations

import os
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.files.text import write_text
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.states import StateIO

Numbers: TypeAlias = NDArray[np.int64]
# Vertices, shape (v, n), and the index of each vertex's parent, shape (v,), below 0 for a root.
Tree: TypeAlias = tuple[Matrix, ArrayLike]
LaterTree: TypeAlias = Callable[[], Tree]  # makes the tree of copies that it holds


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """The result of a search.

    Attributes:
        path: Waypoints, start first, shape (k, n), or None if there is no path.
        statistics: Plain counts of the search.
        difference: Distance from the end of the path to the goal [unit of the space]; 0 if the path is exact.
        reason: Why there is no exact path, if the search can say it.
        graph: Makes the grown graph, by :meth:`SafePlanner.grown`, if it is wanted.
        progress: Pairs of a time since the search began [s] and the length of the best path at that time; for searches
            that improve their path.

    Example:
        >>> rrtik.ompl.SearchResult(None, {"tries": 3}, reason="no free configuration").reason
        'no free configuration'
    """

    path: Matrix | None
    statistics: Mapping[str, int | float] = field(default_factory=dict)
    difference: float = 0.0
    reason: str = ""
    graph: Callable[[], PlannerGraph] | None = None
    progress: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a ``solve`` broke.

    Attributes:
        refused: Whether the planner refused its options, or their meaning for the problem, by an InputError.
        summary: One line, without the type if it is an InputError.
    """

    refused: bool
    summary: str


class IllPosed(Exception):
    """Raised if a problem definition has no starts or goals to search between."""

    def __init__(self, status: ob.PlannerStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


def failure_of(error: BaseException) -> Failure:
    """Return the failure that an exception from a search stands for."""
    if isinstance(error, InputError):
        return Failure(True, str(error))
    return Failure(False, f"{type(error).__name__}: {error}".removesuffix(": ") + _hint(error))


def _hint(error: BaseException) -> str:
    """Return the probable cause of an exception of the bindings that does not name it; "" for other exceptions."""
    if "bad_cast" not in str(error):
        return ""
    return "; a callback returned a value of the wrong type: a validity checker must return a Python bool"


def explained(error: BaseException) -> str:
    """Return an exception with its traceback as text; for the library's own errors their line alone.

    Removes the traceback from the exception and its causes in place, because its frames would keep borrowed states
    alive.
    """
    known = isinstance(error, RrtikError)
    text = str(error) if known else "".join(traceback.format_exception(error)).strip() + _hint(error)

    link: BaseException | None = error
    while link is not None:
        link.__traceback__ = None
        link = link.__context__

    return text


def status_of(found: SearchResult) -> ob.PlannerStatus:
    """Return OMPL's status for the result of a search."""
    if found.path is None:
        return ob.PlannerStatus.TIMEOUT
    return ob.PlannerStatus.APPROXIMATE_SOLUTION if found.difference > 0.0 else ob.PlannerStatus.EXACT_SOLUTION


@dataclass(frozen=True, slots=True, eq=False)
class PlannerGraph:
    """The graph that a planner has grown in its last ``solve``. The arrays are read-only.

    Attributes:
        vertices: Configurations, shape (v, n) [unit of the space].
        edges: Index pairs of vertices whose motion was found free, shape (e, 2); in a tree the parent comes first.
        costs: Length of each edge, shape (e,) [unit of the space].
        starts: Indices of the vertices that are starts.
        goals: Indices of the vertices that are goals.
        births: When each vertex came, shape (v,), from 0; each of two trees of ours counts its own.
        links: Links that MB-RRT has placed in the workspace, for each joint shape (passes, 2, 3) [m].
    """

    vertices: Matrix
    edges: Numbers
    costs: Vector
    starts: Numbers
    goals: Numbers
    births: Numbers
    links: tuple[Matrix, ...] = ()

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the graph as GraphML, which Gephi, NetworkX, igraph and others read.

        The coordinates of a vertex are in ``coords``, separated by commas, as OMPL writes them; ``weight`` of an edge
        is its cost.

        Raises:
            InputError: If the file cannot be written.
        """
        write_text(os.fspath(file), "\n".join([*_graph_ml(self), ""]))

    def planner_data(self, si: ob.SpaceInformation) -> ob.PlannerData:
        """Return the graph as ``ompl.base.PlannerData``, which has its own copies of the states.

        Args:
            si: The SpaceInformation of the planner.
        """
        io = StateIO(si)
        data = ob.PlannerData(si)
        # The data only hold the addresses of the states until they are decoupled, so the states have to live until
        # then.
        states = [si.allocState() for _ in self.vertices]

        starts = set(self.starts.tolist())
        goals = set(self.goals.tolist())

        for number, (one, row) in enumerate(zip(states, self.vertices, strict=True)):
            io.write(one, row)
            vertex = ob.PlannerDataVertex(one)
            if number in starts:
                data.addStartVertex(vertex)
            elif number in goals:
                data.addGoalVertex(vertex)
            else:
                data.addVertex(vertex)

        for first, second in self.edges.tolist():
            data.addEdge(first, second)

        data.decoupleFromPlanner()
        return data


def graph_of(
    vertices: Matrix,
    edges: ArrayLike,
    starts: ArrayLike = (),
    goals: ArrayLike = (),
    births: ArrayLike | None = None,
) -> PlannerGraph:
    """Return a graph whose costs are the lengths of its edges.

    Args:
        vertices: Shape (v, n).
        edges: Index pairs of vertices, shape (e, 2).
        starts: Indices of vertices.
        goals: Indices of vertices.
        births: When each vertex came, shape (v,); None if that is their order.
    """
    pairs = np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    costs = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    came = np.arange(len(vertices)) if births is None else births
    joined, first, last, born = (frozen(each, dtype=np.int64) for each in (pairs, starts, goals, came))
    return PlannerGraph(frozen(vertices), joined, frozen(costs), first, last, born)


def graph_of_trees(starts: Tree | LaterTree, goals: Tree | LaterTree | None = None) -> PlannerGraph:
    """Return the graph of a tree grown from starts and, if there is one, a tree grown from goals."""
    rows: list[Matrix] = []
    edges = []
    roots = []
    births = []
    count = 0

    for given in (starts, goals):
        tree = given() if callable(given) else given
        vertices = np.empty((0, rows[0].shape[1])) if tree is None else np.asarray(tree[0])
        parents = np.empty(0, dtype=np.int64) if tree is None else np.asarray(tree[1], dtype=np.int64)
        grown = np.flatnonzero(parents >= 0)

        rows.append(vertices)
        edges.append(np.stack([parents[grown], grown], axis=1) + count)
        roots.append(np.flatnonzero(parents < 0) + count)
        births.append(np.arange(len(vertices)))
        count += len(vertices)

    first, last = roots
    return graph_of(np.concatenate(rows), np.concatenate(edges), first, last, np.concatenate(births))


def graph_of_path(path: Matrix) -> PlannerGraph:
    """Return a path, shape (k, n), as a graph, for planners that keep no tree."""
    steps = np.arange(len(path) - 1)
    return graph_of(path, np.stack([steps, steps + 1], axis=1), [0], [len(path) - 1])


def without(rows: Matrix, parents: NDArray[np.integer], is_kept: NDArray[np.bool_]) -> Tree:
    """Return a tree without the vertices that are not kept and their descendants.

    Args:
        rows: Vertices, shape (v, n).
        parents: Index of each vertex's parent, below 0 for a root, shape (v,).
        is_kept: Which vertices are kept, shape (v,).
    """
    remains = is_kept.copy()
    parent_or_0 = np.where(parents < 0, 0, parents)

    # Each round drops the children of the vertices that the round before dropped.
    while True:
        still_remains = remains & ((parents < 0) | remains[parent_or_0])
        if (still_remains == remains).all():
            break
        remains = still_remains

    numbers = np.cumsum(remains) - 1
    return rows[remains], np.where(parents < 0, -1, numbers[parent_or_0])[remains]


def nearest_approach(graph: PlannerGraph, goals: Matrix) -> tuple[Matrix, float] | None:
    """Find the vertex that is nearest to a goal, and return the way to it along edges from a start.

    Args:
        graph: The graph of a planner.
        goals: Shape (g, n).

    Returns:
        The way, shape (k, n), and its distance from the goal [unit of the space]; None if nothing is nearer than a
        start.
    """
    predecessors = _predecessors(graph)
    if not predecessors:
        return None

    numbers = np.fromiter(predecessors, dtype=np.int64)
    gaps = np.linalg.norm(graph.vertices[numbers][:, None] - goals[None], axis=2).min(axis=1)
    vertex = int(numbers[gaps.argmin()])
    distance = float(gaps.min())
    if predecessors[vertex] < 0 or distance == 0.0:
        return None

    vertices = [vertex]
    while predecessors[vertices[-1]] >= 0:
        vertices.append(predecessors[vertices[-1]])
    return graph.vertices[vertices[::-1]].copy(), distance


def _predecessors(graph: PlannerGraph) -> dict[int, int]:
    """Return the vertices that edges reach from a start, each with its predecessor, -1 for a start."""
    leaving: dict[int, list[int]] = {}
    for first, second in graph.edges.tolist():
        leaving.setdefault(first, []).append(second)

    predecessors = dict.fromkeys(graph.starts.tolist(), -1)
    waiting = deque(predecessors)

    while waiting:
        vertex = waiting.popleft()
        for head in leaving.get(vertex, ()):
            if head not in predecessors:
                predecessors[head] = vertex
                waiting.append(head)
    return predecessors


def _graph_ml(graph: PlannerGraph) -> Iterator[str]:
    """Yields the lines of a graph as GraphML."""
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    yield '  <key id="coords" for="node" attr.name="coords" attr.type="string"/>'
    yield '  <key id="role" for="node" attr.name="role" attr.type="string"/>'
    yield '  <key id="weight" for="edge" attr.name="weight" attr.type="double"/>'
    yield '  <graph id="graph" edgedefault="directed">'

    roles = dict.fromkeys(graph.goals.tolist(), "goal") | dict.fromkeys(graph.starts.tolist(), "start")
    for number, row in enumerate(graph.vertices.tolist()):
        role = f'<data key="role">{roles[number]}</data>' if number in roles else ""
        coords = ",".join(map(repr, row))
        yield f'    <node id="n{number}"><data key="coords">{coords}</data>{role}</node>'
    for (first, second), cost in zip(graph.edges.tolist(), graph.costs.tolist(), strict=True):
        yield f'    <edge source="n{first}" target="n{second}"><data key="weight">{cost!r}</data></edge>'

    yield "  </graph>"
    yield "</graphml>"
