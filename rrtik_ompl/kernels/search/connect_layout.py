"""The table of an RRT-Connect search in kernels, and the words for its states."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable
from rrtik_ompl.kernels.search.tree_layout import TreeTable

KERNELS = "search.connect_kernels"  # the library of these searches


class ConnectTable(Record):
    """An RRT-Connect search. Lengths are in the unit of the configurations."""

    motions: MotionTable  # of the world
    start_tree: TreeTable
    goal_tree: TreeTable
    lower: Doubles  # the box of configurations, in whole lanes
    upper: Doubles
    inverse_bases: Doubles  # of the sequence of samples

    # Its rules.
    range: float  # longest motion of the trees
    domain: float  # radius in which a vertex is extended once it was blocked
    bound: float  # length that paths have to stay below, see kernels/search/bounded
    resolve: int  # 1 if undecided motions are asked for, 0 if they count as colliding
    patience: int  # rejected paths until undecided motions are asked for before they are inserted
    limit: int  # of the samples
    start_rows: Configuration  # roots
    goal_rows: Configuration
    goal_count: int

    # Samples lie in the box around the centre whose sides are twice the spread, which grows with every sample.
    centre: Doubles
    spread: float
    point: Doubles  # the last sample, in the unit box
    random: int  # state

    # The motion that is checked: from a vertex of the tree that grows to ``row``.
    phase: int
    grower: int  # side of the tree that was extended towards the last sample
    growing: int  # side of the tree
    start: int  # vertex of it
    target: int  # vertex of the other tree at which the motion ends ...
    bridge: int  # ... if this is 1
    row: Configuration
    row_values: JointValues  # of the row; the same memory where they are the same
    query: Floats  # the configuration whose nearest vertex is wanted

    # Where the trees meet, and what is asked.
    start_meeting: int  # vertices
    goal_meeting: int
    meeting_state: int  # of the motion between them
    asked: int  # what
    questions: int
    question_starts: Configuration
    question_ends: Configuration
    question_sides: Ints  # to a vertex of which tree each motion leads
    question_vertices: Ints  # and to which, or NO_VERTEX
    answers: Ints

    # Counts.
    iterations: int
    rejected: int  # paths
    checked: int  # motions
    straight_tried: int  # goals

    path: Configuration  # memory for ``path_capacity`` rows
    path_capacity: int
    path_rows: int  # how many the path has, which is there if there is room for it


UNBOUNDED_COST = 1e30  # [unit of the configurations] of the bound: paths of any length
UNBOUNDED_SPREAD = 1e30  # [unit of the configurations] samples lie in the whole box
UNBOUNDED_DOMAIN = 1e30  # [unit of the configurations] of a vertex that was never blocked

STRAIGHT, EXTEND, CONNECT = range(3)  # phases
NO_QUESTION, MOTION_QUESTION, PATH_QUESTION = range(3)  # what is asked
NO_VERTEX = -1  # to which a question's motion leads
SOLVED, EXHAUSTED, RUNNING, ASKING, FULL = range(5)  # status
OUTSIDE = -1  # status that a root is not in the box; less its number
MAX_QUESTIONS = 64  # at a time
RESULT_NUMBERS = 7  # of one of several queries: status, rows, samples, motions, vertices, questions, rejected paths
