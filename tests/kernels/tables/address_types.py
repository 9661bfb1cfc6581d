# mypy: enable-error-code="arg-type"
"""Addresses that are passed for others are type errors: each kind of table, array and record has a type of its own.

Nothing here runs. mypy, which reads this file with the other tests, fails where a call of ``right`` is an error, and
where one of ``swapped`` is none and its ``ignore`` is idle.
"""

from rrtik_ompl.kernels.checks.check_kernels import check_edge
from rrtik_ompl.kernels.checks.distance_kernels import measure_scene
from rrtik_ompl.kernels.checks.kinematics import forward_kinematics
from rrtik_ompl.kernels.checks.sphere_kernels import scene_collision
from rrtik_ompl.kernels.ik.ik_kinematics import measure
from rrtik_ompl.kernels.ik.ik_layout import Aim, CallTable, Pose
from rrtik_ompl.kernels.layout import (
    NO_MARKS,
    NO_WATCH,
    ArmTable,
    Ball,
    BallTable,
    Centre,
    Cluster,
    Group,
    JointValues,
    LikelyBall,
    PrimitiveTable,
    ProbeTable,
    ScratchTable,
    WorldTable,
)
from rrtik_ompl.kernels.search.connect_kernels import check_candidate
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.crdt.kernels import add_free_edges
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.motions.motion_kernels import check_motion
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.search.tree_kernels import parent_of
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.two_trees_kernels import nearest_to
from rrtik_ompl.kernels.tables.accessors import first_ball_of, radius_at


def right(
    world: WorldTable,
    arm: ArmTable,
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    likely: LikelyBall,
    values: JointValues,
    probe: ProbeTable,
    cluster: Cluster,
    array: Ball,
    aim: Aim,
    call: CallTable,
    motions: MotionTable,
    connect: ConnectTable,
    tree: TreeTable,
    row: Configuration,
    crdt: CrdtTable,
    crdt_tree: CrdtTreeTable,
) -> None:
    check_motion(motions, row, row, True)
    check_candidate(connect)
    nearest_to(connect, 0, row)
    parent_of(tree, 0)
    add_free_edges(crdt, crdt_tree)
    forward_kinematics(arm, scratch)
    scene_collision(balls, primitives, scratch, 1, NO_MARKS, True, likely, NO_WATCH)
    check_edge(world, values, values, 3, False)
    measure_scene(balls, primitives, scratch, probe)
    first_ball_of(cluster)
    radius_at(array, 0)
    measure(call, aim, aim)


def swapped(
    world: WorldTable,
    arm: ArmTable,
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    likely: LikelyBall,
    values: JointValues,
    probe: ProbeTable,
    group: Group,
    centres: Centre,
    pose: Pose,
    call: CallTable,
    motions: MotionTable,
    connect: ConnectTable,
    tree: TreeTable,
    row: Configuration,
    crdt: CrdtTable,
    crdt_tree: CrdtTreeTable,
) -> None:
    check_motion(world, row, row, True)  # type: ignore[arg-type]
    check_motion(motions, values, row, True)  # type: ignore[arg-type]
    check_candidate(crdt)  # type: ignore[arg-type]
    nearest_to(connect, 0, values)  # type: ignore[arg-type]
    parent_of(crdt_tree, 0)  # type: ignore[arg-type]
    add_free_edges(crdt, tree)  # type: ignore[arg-type]
    forward_kinematics(scratch, arm)  # type: ignore[arg-type]
    scene_collision(primitives, balls, scratch, 1, NO_MARKS, True, likely, NO_WATCH)  # type: ignore[arg-type]
    check_edge(values, world, values, 3, False)  # type: ignore[arg-type]
    measure_scene(balls, primitives, probe, scratch)  # type: ignore[arg-type]
    first_ball_of(group)  # type: ignore[arg-type]
    radius_at(centres, 0)  # type: ignore[arg-type]
    measure(call, pose, pose)  # type: ignore[arg-type]
    check_edge(world, 8, values, 3, False)  # type: ignore[arg-type]
