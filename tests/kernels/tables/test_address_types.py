"""mypy finds addresses that are passed for others: each kind of table, array and record has a type of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")

SNIPPET = """\
from rrtik_ompl.kernels.checks.check_kernels import check_edge
from rrtik_ompl.kernels.checks.distance_kernels import measure_scene
from rrtik_ompl.kernels.checks.kinematics import forward_kinematics
from rrtik_ompl.kernels.checks.sphere_kernels import scene_collision
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.connect_motions import check_candidate, nearest_to
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.growth import add_free_edges
from rrtik_ompl.kernels.search.motions.motion_kernels import check_motion
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.search.tree_kernels import parent_of
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.ik.ik_kinematics import measure
from rrtik_ompl.kernels.ik.ik_layout import Aim, CallTable, Pose
from rrtik_ompl.kernels.tables.accessors import first_ball_of, radius_at
from rrtik_ompl.kernels.layout import (
    NO_MARKS, NO_WATCH, ArmTable, BallArray, BallTable, CentreArray, Cluster, Group, JointValues, LikelyBalls,
    PrimitiveTable, ProbeTable, ScratchTable, WorldTable,
)


def right(
    world: WorldTable, arm: ArmTable, balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable,
    likely: LikelyBalls, values: JointValues, probe: ProbeTable, cluster: Cluster, array: BallArray, aim: Aim,
    call: CallTable, motions: MotionTable, connect: ConnectTable, tree: TreeTable, row: Configuration,
    crdt: CrdtTable, crdt_tree: CrdtTreeTable,
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
    world: WorldTable, arm: ArmTable, balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable,
    likely: LikelyBalls, values: JointValues, probe: ProbeTable, group: Group, centres: CentreArray, pose: Pose,
    call: CallTable, motions: MotionTable, connect: ConnectTable, tree: TreeTable, row: Configuration,
    crdt: CrdtTable, crdt_tree: CrdtTreeTable,
) -> None:
    check_motion(world, row, row, True)
    check_motion(motions, values, row, True)
    check_candidate(crdt)
    nearest_to(connect, 0, values)
    parent_of(crdt_tree, 0)
    add_free_edges(crdt, tree)
    forward_kinematics(scratch, arm)
    scene_collision(primitives, balls, scratch, 1, NO_MARKS, True, likely, NO_WATCH)
    check_edge(values, world, values, 3, False)
    measure_scene(balls, primitives, probe, scratch)
    first_ball_of(group)
    radius_at(centres, 0)
    measure(call, pose, pose)
    check_edge(world, 8, values, 3, False)
"""


def test_swapped_addresses_are_type_errors(tmp_path):
    file = tmp_path / "swapped.py"
    file.write_text(SNIPPET)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "--config-file"]
    root = Path(__file__).resolve().parents[1]
    while not (root / "pyproject.toml").is_file():
        root = root.parent
    done = subprocess.run([*command, str(root / "pyproject.toml"), str(file)], capture_output=True, text=True, cwd=root)
    lines = SNIPPET.splitlines()
    wrong = {lines[int(line.split(":")[1]) - 1].strip() for line in done.stdout.splitlines() if "[arg-type]" in line}
    assert wrong == {line.strip() for line in lines[lines.index("def swapped(") + 6 :]}, done.stdout + done.stderr
