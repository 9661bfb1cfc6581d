"""The table of a path's check and repair in kernels, and the words for their results."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Record
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable
from rrtik_ompl.kernels.search.shortcut_layout import ShortcutTable

KERNELS = "search.repair_kernels"  # their library


class RepairTable(Record):
    """The check of a path, and its repair."""

    motions: MotionTable  # of the world
    search: ConnectTable  # an RRT-Connect search in that world
    shortcuts: ShortcutTable  # of what it finds
    step: float  # longest edge of the path's points
    box_ratio: float  # half the side of the first sample's box over the gap
    given: Configuration  # the path as it was given
    points: Configuration  # along it
    path: Configuration  # the repaired one
    capacity: int  # of the given path and the points, in rows
    count: int  # of points
    first: int  # blocked edge between points, seen from the beginning
    last: int  # the same, seen from the end
    checked: int  # configurations that the check of a path counts
    tries: int  # of the shortcuts
    patience: int


HIT, FREE_PATH, NO_ROOM = range(3)  # what check_path() returns
UNFINISHED, NO_PATH, TOO_LONG = -1, -2, -3  # what repair() and finish() return in place of a number of rows
