"""TITAN-4 follows a target that moves: jumps where the branch of the inverse kinematics changes [1, ch. 4.4.2]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory.limits import RateLimits

SOURCE = "[1, ch. 4.4.2]"
FRAMES, HELD, RATE = 600, 600, 30.0  # frames that move, that stand at the end, [Hz]
JUMP = 10.0  # [deg] of a joint from frame to frame
NEAR = 1e-6  # [rad]: on its solution
TARGETS = "targets that wander between two random postures in 20 s and stay reachable; all chosen here"


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Solutions of each frame, shape (m, 8, 6), and which of them will do, shape (m, 8)."""

    branches: Matrix
    valid: Mask


def targets(robot: Robot, count: int, rng: np.random.Generator) -> list[Target]:
    """Poses on screw motions, each frame with a solution inside the limits, but none of one branch throughout."""
    found: list[Target] = []
    while len(found) < count:
        ends = [robot.fk(q) for q in rng.uniform(robot.lower, robot.upper, (2, robot.dof))]
        twist = pin.log6(ends[0].actInv(ends[1]))
        shares = np.append(np.linspace(0.0, 1.0, FRAMES), np.ones(HELD))
        poses = np.array([(ends[0] * pin.exp6(share * twist)).homogeneous for share in shares])
        each = solutions(robot, poses, check=False)
        if each.valid.any(axis=1).all() and not each.valid[:FRAMES].all(axis=0).any():
            found.append(Target(np.asarray(each.branches), np.asarray(each.valid)))
    return found


def best_of_each(robot: Robot, target: Target) -> Matrix:
    """In each frame the solution that is farthest from the limits; shape (m, 6)."""
    room = np.minimum(target.branches - robot.lower, robot.upper - target.branches).min(axis=2)
    best = np.where(target.valid, room, -np.inf).argmax(axis=1)
    row: Matrix = target.branches[np.arange(len(best)), best]
    return row


def kept(target: Target, first: Vector) -> Matrix:
    """In each frame the solution that is nearest to that of the frame before; shape (m, 6)."""
    q, rows = first, []
    for branches, valid in zip(target.branches, target.valid, strict=True):
        away = np.where(valid, np.abs(branches - q).max(axis=1), np.inf)
        q = branches[int(away.argmin())]
        rows.append(q)
    return np.array(rows)


def smooth(target: Target, first: Vector, rates: Vector) -> tuple[Matrix, Mask]:
    """The same at no more than the joints' rates [rad/s]: after a change it catches up; rows, and where it is on it."""
    q, rows, on = first, [], []
    for branches, valid in zip(target.branches, target.valid, strict=True):
        seconds = np.where(valid, (np.abs(branches - q) / rates).max(axis=1), np.inf)
        wanted = branches[int(seconds.argmin())]
        q = q + np.clip(wanted - q, -rates / RATE, rates / RATE)
        rows.append(q)
        on.append(bool(np.abs(q - wanted).max() < NEAR))
    return np.array(rows), np.array(on)


def jumps(rows: Matrix) -> int:
    """Frames in which a joint moves by more than `JUMP`."""
    return int((np.degrees(np.abs(np.diff(rows, axis=0))) > JUMP).any(axis=1).sum())


def tracking(quick: bool) -> list[Row]:
    """What happens where the branch that is followed ends at a limit."""
    robot, count = rrtik.load_robot("titan4"), 3 if quick else 50
    rates, each = RateLimits.of(robot).velocity, targets(robot, count, np.random.default_rng(11))
    best = [best_of_each(robot, target) for target in each]
    near = [kept(target, rows[0]) for target, rows in zip(each, best, strict=True)]
    slow = [smooth(target, rows[0], rates) for target, rows in zip(each, best, strict=True)]
    without, with_it = (sum(jumps(rows) for rows in some) for some in (best, near))
    fastest = max(float((np.abs(np.diff(rows, axis=0)) * RATE / rates).max()) for rows, _ in slow)
    caught = sum(bool(on[-1]) for _, on in slow)
    off = np.array([(~on).sum() / RATE for _, on in slow])
    return [
        judged("jumps, the best solution of each frame", "visible", f"{without / count:.2f} a target", without / count,
               Bar((0.0, 1e4), held=(0.1, 1e4)), f"{count} {TARGETS}; each has no branch that serves throughout"),
        judged("jumps, the branch kept while it can be, over these", "no more", f"{with_it / max(without, 1):.2f}",
               with_it / max(without, 1), Bar((0.0, 1e4), held=(0.0, 1.0)), f"{with_it / count:.2f} a target"),
        judged("smooth change: fastest joint over its limit", "smooth", f"{fastest:.3f}", fastest,
               Bar((0.0, 1e4), held=(0.0, 1.0 + 1e-9)), "no joint faster than its rate; the new branch is the soonest"),
        judged("smooth change: targets caught again", "implied", f"{caught} of {count}", caught / count, all_of(),
               f"off the target for {np.median(off):.1f} s (median), {off.max():.1f} s at most"),
    ]  # fmt: skip


TABLES = (
    Table(
        "titan4-tracking",
        "A target that moves: changes of branch",
        SOURCE,
        tracking,
        10,
        1,
        bars="the source says jumps and smooth; all numbers ours",
    ),
)
