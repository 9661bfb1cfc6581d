"""What kernels of proofs read from their table, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.simd.access import field_reader, int_column
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import double_at

joint_count_of: Callable[[ProofTable], int] = field_reader(layout.JOINT_COUNT)
parents_of: Callable[[ProofTable], int] = field_reader(layout.PARENTS)
sliding_of: Callable[[ProofTable], int] = field_reader(layout.SLIDING)
joints_of: Callable[[ProofTable], int] = field_reader(layout.JOINTS)
solids_of: Callable[[ProofTable], int] = field_reader(layout.SOLIDS)
sizes_of: Callable[[ProofTable], int] = field_reader(layout.SIZES)
corners_of: Callable[[ProofTable], int] = field_reader(layout.CORNERS)
sweep_count_of: Callable[[ProofTable], int] = field_reader(layout.SWEEP_COUNT)
sweeps_of: Callable[[ProofTable], int] = field_reader(layout.SWEEPS)
reaches_of: Callable[[ProofTable], int] = field_reader(layout.REACHES)
body_pair_count_of: Callable[[ProofTable], int] = field_reader(layout.BODY_PAIR_COUNT)
pair_count_of: Callable[[ProofTable], int] = field_reader(layout.PAIR_COUNT)
pairs_of: Callable[[ProofTable], int] = field_reader(layout.PAIRS)
margins_of: Callable[[ProofTable], int] = field_reader(layout.MARGINS)
frames_of: Callable[[ProofTable], int] = field_reader(layout.FRAMES)
stamps_of: Callable[[ProofTable], int] = field_reader(layout.STAMPS)
bends_of: Callable[[ProofTable], int] = field_reader(layout.BENDS)
ways_of: Callable[[ProofTable], int] = field_reader(layout.WAYS)
lists_of: Callable[[ProofTable], int] = field_reader(layout.LISTS)
counts_of: Callable[[ProofTable], int] = field_reader(layout.COUNTS)
stack_of: Callable[[ProofTable], int] = field_reader(layout.STACK)
seen_of: Callable[[ProofTable], int] = field_reader(layout.SEEN)
top_count_of: Callable[[ProofTable], int] = field_reader(layout.TOP_COUNT)
top_pairs_of: Callable[[ProofTable], int] = field_reader(layout.TOP_PAIRS)
last_stamp_of: Callable[[ProofTable], int] = field_reader(layout.LAST_STAMP)
log_room_of: Callable[[ProofTable], int] = field_reader(layout.LOG_ROOM)
log_of: Callable[[ProofTable], int] = field_reader(layout.LOG)
log_ways_of: Callable[[ProofTable], int] = field_reader(layout.LOG_WAYS)
log_count_of: Callable[[ProofTable], int] = field_reader(layout.LOG_COUNT)
clouds_of: Callable[[ProofTable], int] = field_reader(layout.CLOUDS)
cloud_poses_of: Callable[[ProofTable], int] = field_reader(layout.CLOUD_POSES)

# Function (array, number) that reads one number of a record.
frame_of_solid: Callable[[int, int], int] = int_column(layout.SOLID_SIZE, layout.SOLID_FRAME)
first_block_of: Callable[[int, int], int] = int_column(layout.SOLID_SIZE, layout.FIRST_BLOCK)
end_block_of: Callable[[int, int], int] = int_column(layout.SOLID_SIZE, layout.END_BLOCK)
kind_of_solid: Callable[[int, int], int] = int_column(layout.SOLID_SIZE, layout.SOLID_KIND)
frame_of_sweep: Callable[[int, int], int] = int_column(layout.SWEEP_SIZE, layout.SWEEP_FRAME)
base_of_sweep: Callable[[int, int], int] = int_column(layout.SWEEP_SIZE, layout.SWEEP_BASE)
one_of_pair: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.PAIR_ONE)
other_of_pair: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.PAIR_OTHER)
base_of_pair: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.PAIR_BASE)
one_sweep_of: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.ONE_SWEEP)
other_sweep_of: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.OTHER_SWEEP)
first_part_of: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.PARTS_FIRST)
end_part_of: Callable[[int, int], int] = int_column(layout.PAIR_SIZE, layout.PARTS_END)


@inlined
def vector_at(array: int, place: int) -> Any:
    """Three float64 of an array from a place on."""
    return double_at(array, place), double_at(array, place + 1), double_at(array, place + 2)


@inlined
def size_at(table: ProofTable, solid: int, place: int) -> float:
    """One of the sizes of a solid."""
    number: float = double_at(sizes_of(table), layout.SIZE_COUNT * solid + place)
    return number


@inlined
def sizes_at(table: ProofTable, solid: int, place: int) -> Any:
    """Three of the sizes of a solid."""
    return vector_at(sizes_of(table), layout.SIZE_COUNT * solid + place)


@inlined
def node_frames(table: ProofTable, node: int) -> int:
    """Where the frames of a node begin, counted in float64; the first one is the world."""
    place: int = layout.FRAME_SIZE * (joint_count_of(table) + 1) * node
    return place
