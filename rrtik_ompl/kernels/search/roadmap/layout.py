"""The table of a roadmap in kernels, and the words for its states."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Floats, Ints
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.two_trees_layout import SampledTable

KERNELS = "search.roadmap.kernels"  # the library of roadmaps


class RoadmapTable(SampledTable):
    """A roadmap, and a query on it.

    Edge e is the halves 2 e and 2 e + 1, one each way. The vertices from ``mapped`` on are the starts of the query,
    then its goals.
    """

    vertices: TreeTable  # a tree whose parents nobody reads
    halves: int  # how many there are
    to: Ints  # the vertex that a half leads to
    next: Ints  # the next half that leaves the same vertex
    heads: Ints  # the first half that leaves a vertex
    lengths: Doubles  # of the edges
    states: Ints  # of the edges

    near: int  # how many nearest vertices are wanted of a configuration
    near_vertices: Ints  # nearest first
    near_squares: Floats  # of their distances

    mapped: int
    starts: int
    costs: Doubles  # length of the path to each vertex
    ahead: Doubles  # what lies ahead of each vertex at least
    came: Ints  # the half by which each vertex was reached
    heap_size: int
    heap: Ints  # halves to follow, the least key first
    keys: Doubles
    meeting: int  # the goal that was reached
    questions: Ints  # halves of its path that are asked for
    asked: int  # how many

    checked: int  # motions
    samples: int  # that were drawn


UNKNOWN, SURE, DOUBTFUL, BLOCKED = range(4)  # state of an edge: not looked at, free, left undecided, not free
UNSEEN, ROOT, END = -2, -1, -1  # of ``came``: not reached, a start; of ``heads`` and ``next``: no further half
NOT_COMPUTED = -1.0  # of ``ahead``
SOLVED, EXHAUSTED, RUNNING, ASKING = range(4)  # status
MAX_QUESTIONS = 64  # at a time
