"""The tree or graph that a planner has grown, its edges in the order in which they came."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.copies import as_value, in_one_line


@dataclass(frozen=True, slots=True, eq=False)
class SearchTree:
    """What a planner has grown in the search that found a path, or in its last one if none did. Arrays are read-only.

    Attributes:
        planner: Name of the planner.
        vertices: Configurations, shape (v, dof) [rad or m].
        edges: The two vertices of each edge by their numbers, in the order in which edges came, shape (e, 2).
            Its motion is straight; it was found free by the checks of the search, which prove nothing.
        steps: When each edge came, shape (e,), ascending: the number of its later vertex. Of two trees, each counts its
            own vertices.
        starts: Numbers of vertices that are starts.
        goals: Numbers of vertices that are goals.
        links: For MB-RRT, the links that its tree in the workspace has placed, for each joint an array of shape
            (passes, 2, 3) [m]; empty for other planners.

    Example:
        >>> plan = rrtik.plan(rrtik.load_problem("env_e"), "crdt", seed=1, tree=True)
        >>> plan.tree.edges.shape[1]
        2
    """

    planner: str
    vertices: Matrix
    edges: NDArray[np.int64]
    steps: NDArray[np.int64]
    starts: NDArray[np.int64]
    goals: NDArray[np.int64]
    links: tuple[Matrix, ...] = ()

    __reduce__ = as_value
    __repr__ = in_one_line
