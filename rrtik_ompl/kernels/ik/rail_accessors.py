"""What kernels read from the table of a rail, by name; see :mod:`rrtik_ompl.kernels.tables.accessors`.

The places are those of :mod:`rrtik_ompl.kernels.ik.rail_layout`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.ik import rail_layout
from rrtik_ompl.kernels.ik.ik_layout import Configuration, Doubles, Pose
from rrtik_ompl.kernels.simd.access import double_reader, double_vector_reader, field_reader
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import double_at, set_field

# Table
rail_of: Callable[[rail_layout.RailTable], rail_layout.Rail] = field_reader(rail_layout.RAIL)
capacity_of: Callable[[rail_layout.RailTable], int] = field_reader(rail_layout.CAPACITY)
row_count_of: Callable[[rail_layout.RailTable], int] = field_reader(rail_layout.COUNT)
rows_of: Callable[[rail_layout.RailTable], Configuration] = field_reader(rail_layout.Q)
shares_of: Callable[[rail_layout.RailTable], Doubles] = field_reader(rail_layout.SHARES)
levers_of: Callable[[rail_layout.RailTable], Doubles] = field_reader(rail_layout.LEVERS)
reference_of: Callable[[rail_layout.RailTable], Configuration] = field_reader(rail_layout.REFERENCE)
pull_of: Callable[[rail_layout.RailTable], Doubles] = field_reader(rail_layout.PULL)
settings_of: Callable[[rail_layout.RailTable], Doubles] = field_reader(rail_layout.SETTINGS)
trial_of: Callable[[rail_layout.RailTable], Configuration] = field_reader(rail_layout.TRIAL)
middle_of: Callable[[rail_layout.RailTable], Configuration] = field_reader(rail_layout.MIDDLE)

# Rail
centre_of: Callable[[rail_layout.Rail], Any] = double_vector_reader(rail_layout.CENTRE)
arc_axis_of: Callable[[rail_layout.Rail], Any] = double_vector_reader(rail_layout.ARC_AXIS)
slide_of: Callable[[rail_layout.Rail], Any] = double_vector_reader(rail_layout.SLIDE)
turn_axis_of: Callable[[rail_layout.Rail], Any] = double_vector_reader(rail_layout.TURN_AXIS)
arc_angle_of: Callable[[rail_layout.Rail], float] = double_reader(rail_layout.ARC_ANGLE)
turn_angle_of: Callable[[rail_layout.Rail], float] = double_reader(rail_layout.TURN_ANGLE)
arc_radius_of: Callable[[rail_layout.Rail], float] = double_reader(rail_layout.ARC_RADIUS)


@inlined
def begin_of(rail: rail_layout.Rail) -> Pose:
    """The pose of the tip at the beginning of a rail."""
    return rail  # type: ignore[return-value]


@inlined
def setting(table: rail_layout.RailTable, place: int) -> float:
    """One of the settings."""
    value: float = double_at(settings_of(table), place)
    return value


@inlined
def set_row_count(table: rail_layout.RailTable, count: int) -> None:
    """Set how many configurations there are."""
    set_field(table, rail_layout.COUNT, count)
