"""Motions that must be proven free where their world says so: a quick look for collisions, then the proof."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.check_kernels import inner_collision
from rrtik_ompl.kernels.checks.kinematics import forward_kinematics
from rrtik_ompl.kernels.layout import COLLIDING, FREE, JointValues, WorldTable
from rrtik_ompl.kernels.proof.frames import node_frames
from rrtik_ompl.kernels.proof.layout import NODES, OPEN, ProofTable
from rrtik_ompl.kernels.proof.proof_kernels import apart, begin_motion, prove_motion, visit
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.search.motions.motion_kernels import (
    check_motion,
    resolves,
    set_joint_values,
)
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, lane_numbers, set_wide_lanes
from rrtik_ompl.kernels.simd.records import exists
from rrtik_ompl.kernels.tables.accessors import joint_row

LOOKS = 2  # blocks of configurations, spread over a motion, that are looked at before it is proven


@kernel
def seen_colliding(world: WorldTable, start: JointValues, end: JointValues) -> bool:
    """Whether the inner balls meet something at one of a few configurations of a motion."""
    scratch = world.scratch
    joints = world.arm.joint_count
    values = scratch.values
    every = bits(lane_numbers() >= 0.0)
    for block in range(LOOKS):
        share = (lane_numbers() * float(LOOKS) + float(block)) / float(LOOKS * WIDTH - 1)
        for joint in range(joints):
            set_wide_lanes(values, joint, (1.0 - share) * start[joint] + share * end[joint])
        forward_kinematics(world.arm, scratch)
        if inner_collision(world, every, block >= 0) != 0:
            return True
    return False


@kernel
def open_at(proof: ProofTable, start: JointValues, end: JointValues, pair: int, place: float) -> bool:
    """Whether a pair is not proven apart at one place of a motion."""
    node = int(place * (NODES - 1))
    begin_motion(proof, start, end)
    visit(proof, start, end, node)
    frames = node_frames(proof, node)
    return bool(apart(proof, pair, frames, frames, 0.0) == OPEN)


@inlined
def both_ends(motions: MotionTable, start: Configuration, end: Configuration) -> Any:
    """The joint values of both ends of a motion."""
    values = motions.ends
    others = joint_row(values, motions.joints, 1)
    set_joint_values(motions, start, values)
    set_joint_values(motions, end, others)
    return values, others


@kernel
def judge_motion(motions: MotionTable, start: Configuration, end: Configuration, resolve: bool) -> int:
    """As check_motion, but FREE or not where only proven motions count as free."""
    proof = motions.proof
    if not exists(proof):
        checked: int = check_motion(motions, start, end, resolve)
        return checked
    values, others = both_ends(motions, start, end)
    if seen_colliding(motions.world, values, others):
        return COLLIDING
    pair, _ = prove_motion(proof, values, others)
    return FREE if pair < 0 else COLLIDING


@kernel
def judge_near(motions: MotionTable, start: Configuration, end: Configuration, hint: Doubles) -> int:
    """As judge_motion; the hint is where a motion near by was not proven, a pair and a place, and is looked at first.

    A new failure is noted there. Its pair is -1 if none is known.
    """
    proof = motions.proof
    if not exists(proof):
        checked: int = check_motion(motions, start, end, resolves(motions))
        return checked
    values, others = both_ends(motions, start, end)
    pair = int(hint[0])
    if pair >= 0 and open_at(proof, values, others, pair, hint[1]):
        return COLLIDING
    if seen_colliding(motions.world, values, others):
        return COLLIDING
    pair, place = prove_motion(proof, values, others)
    if pair < 0:
        return FREE
    hint[0] = float(pair)
    hint[1] = place
    return COLLIDING


@entry
def judge(motions: MotionTable, starts: Configuration, ends: Configuration, count: int, answers: Ints) -> int:
    """Check motions between rows of two arrays; int32 answers. Returns how many are free."""
    free = 0
    dof = motions.dof
    for k in range(count):
        answer = judge_motion(motions, row_at(starts, dof, k), row_at(ends, dof, k), True)
        answers[k] = answer
        free += 1 if answer == FREE else 0
    return free
