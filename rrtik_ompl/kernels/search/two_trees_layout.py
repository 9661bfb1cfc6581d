"""What the tables of several searches begin with: how a box is sampled, and two trees that grow towards each other."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.record import Doubles, Floats, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable
from rrtik_ompl.kernels.search.tree_layout import TreeTable


class SampledTable(Record):
    """A search that draws configurations from a box."""

    motions: MotionTable  # of the world
    lower: Doubles  # the box of configurations, in whole lanes
    upper: Doubles
    inverse_bases: Doubles  # of the sequence of samples
    point: Doubles  # the last sample, in the unit box
    random: int  # state

    row: Configuration  # the one that is looked at
    row_values: JointValues  # of the row; the same memory where they are the same
    query: Floats  # the configuration whose nearest vertex is wanted
    resolve: int  # 1 if undecided motions are asked for, 0 if they count as colliding


class TwoTreesTable(SampledTable):
    """A search by a tree from the starts and one from the goals. Lengths are in the unit of the configurations."""

    start_tree: TreeTable
    goal_tree: TreeTable
    start_rows: Configuration  # roots
    goal_rows: Configuration
    goal_count: int
    straight_tried: int  # goals that were aimed at straight away
    domain: float  # radius in which a vertex is extended once it was blocked
    limit: int  # of the samples

    grower: int  # side of the tree that was extended towards the last sample
    start_meeting: int  # vertices at which the trees meet
    goal_meeting: int

    iterations: int  # samples
    checked: int  # motions


UNBOUNDED_DOMAIN = 1e30  # [unit of the configurations] of a vertex that was never blocked
