"""Inverse kinematics on the same reachable poses: every method of ours beside those of other libraries.

In blocks of 50 poses all methods take turns; time is processor time of the whole process, so that a library with two
threads pays for both. The others come with ``pip install -e ".[peers]"``; one that is absent is named with the reason.
A method that has used up its budget takes no more poses: the column "poses" says how many it was asked. Some minutes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, get_args

import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.peers.ik import Solver, solvers
from bench.peers.libraries.eaik import eaik_robot, turned_back
from bench.shared.run import Run
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import IkMethod, one_of
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.kernel_tables import KernelCall, seeded_limb_of
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.ik.solve import list_methods
from rrtik_ompl.ik.targets import pose_rows
from rrtik_ompl.kernels.ik.ik_layout import KERNELS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.robot import Robot

PACKAGES = ("numpy", "pin", "numba", "pytracik", "ikpy", "eaik", "roboticstoolbox-python")
ARMS = ("ur5", "panda", "puma560", "titan4")
METRES, RADIANS = 1e-3, 1e-2  # a configuration this near to the pose and inside the limits solves it
BLOCK = 50  # poses before the next method takes its turn
PEER_BUDGET = 7  # times the budget of a method of ours
KERNEL_BARS = {"ur5": 10.0, "panda": 40.0}  # [us]
KERNEL = "kernel alone"
OTHERS = ("pytracik", "ikpy", "damped", "pinocchio", "ccd")  # numeric methods not of ours
COMPILED = "roboticstoolbox"  # a loop in C, beyond what the bar names
HEAD = ["method", "poses", "solved", "median [us]", "p95 [us]", "median [m]", "worst [m]", "worst [rad]"]


@dataclass
class Runs:
    """What one method did on the poses of an arm."""

    solve: Solver
    budget: float
    times: list[float] = field(default_factory=list)
    off: list[tuple[float, float]] = field(default_factory=list)

    def take(self, robot: Robot, pose: np.ndarray) -> None:
        """Solve for one more pose unless the budget is used up."""
        if not self.left:
            return
        begin = time.process_time_ns()
        q = self.solve(pose)
        self.times.append(1e-3 * (time.process_time_ns() - begin))
        if q is not None and robot.within_limits(q).all():
            off = pin.log6(robot.fk(q).actInv(pin.SE3(pose)))
            distance = float(np.linalg.norm(robot.fk(q).translation - pose[:3, 3]))
            if distance <= METRES and np.linalg.norm(off.angular) <= RADIANS:
                self.off.append((distance, float(np.linalg.norm(off.angular))))

    @property
    def left(self) -> bool:
        """Whether there is budget left."""
        return 1e-6 * sum(self.times) <= self.budget

    @property
    def share(self) -> float:
        """Of the poses that were solved."""
        return len(self.off) / len(self.times)

    @property
    def median(self) -> float:
        """Time [us]."""
        return float(np.median(self.times))

    def row(self, name: str) -> list[str]:
        """A row of the table."""
        off = np.array(self.off or [(np.nan, np.nan)])
        figures = [f"{self.median:,.0f}", f"{np.quantile(self.times, 0.95):,.0f}", f"{np.median(off[:, 0]):.0e}"]
        return [name, str(len(self.times)), f"{self.share:.1%}", *figures, *(f"{x:.0e}" for x in off.max(axis=0))]


def kernel_alone(robot: Robot, start: np.ndarray) -> Solver:
    """The kernel without the face around it: one call for one pose, restarts included."""
    limb, kernels = seeded_limb_of(robot), library(KERNELS)
    assert limb is not None
    assert kernels is not None
    call = KernelCall(limb, pose_rows(np.eye(4)[None]), start[None], STEPS, PATIENCE, start[None], np.zeros(1, int))
    aims, limb_address, address = call.aims, limb.address, call.address

    def solve(pose: np.ndarray) -> np.ndarray | None:
        call.next[0] = 0
        aims[0, :9], aims[0, 9:12] = pose[:3, :3].ravel(), pose[:3, 3]
        return call.q[0] if kernels.solve(limb_address, address) else None

    return solve


def by_face(robot: Robot, method: IkMethod, pose: np.ndarray) -> np.ndarray | None:
    found = rrtik.solve_ik(robot, rrtik.PoseGoal(pose), method=method, seconds=2.0).solutions
    return found[0] if len(found) else None


def single(robot: Robot, poses: np.ndarray, budget: float, methods: Sequence[str]) -> tuple[dict[str, Runs], list[str]]:
    """Methods of ours and the peers' on the poses, taking turns; and who is absent."""
    runs, absent = {}, []
    start = mid_range_configuration(robot)
    for method in methods:
        try:
            if method == KERNEL:
                runs[method] = Runs(kernel_alone(robot, start), budget)
                continue
            named = one_of(get_args(IkMethod), method, "IK method")
            by_face(robot, named, poses[0])
            runs[method] = Runs(partial(by_face, robot, named), budget)
        except InputError as error:
            absent.append(f"{robot.name}, {method}: {str(error).split(';')[0]}")
    for name, solver in solvers(robot, start).items():
        if isinstance(solver, str):
            absent.append(f"{robot.name}, {name}: {solver}")
        else:
            solver(poses[0])
            runs[name] = Runs(solver, PEER_BUDGET * budget)
    for begin in range(0, len(poses), BLOCK):
        for run in runs.values():
            if run.left:
                run.solve(poses[begin])  # what ran before has emptied the caches
            for pose in poses[begin : begin + BLOCK]:
                run.take(robot, pose)
    return runs, absent


def batches(robot: Robot, poses: np.ndarray, repeats: int = 5) -> dict[str, tuple[float, float]]:
    """Of all poses in one call: share solved (NaN: not judged) and processor time per pose [us], median of repeats."""
    work: dict[str, Callable[[], float]] = {
        f"solve_ik_many, {method}": partial(_batch_share, robot, poses, method) for method in ("auto", "numeric")
    }
    try:
        other, at_zero = eaik_robot(robot)
        turned = turned_back(poses, at_zero)
        work["eaik, one thread"] = lambda: np.nan if other.IK_batched(turned, 1) else 0.0
    except (ImportError, ValueError):
        pass
    times: dict[str, list[float]] = {name: [] for name in work}
    shares = {}
    for _ in range(repeats + 1):
        for name, run in work.items():
            begin = time.process_time_ns()
            shares[name] = run()
            times[name].append(1e-3 * (time.process_time_ns() - begin) / len(poses))
    return {name: (shares[name], float(np.median(each[1:]))) for name, each in times.items()}


def _batch_share(robot: Robot, poses: np.ndarray, method: IkMethod) -> float:
    return float(rrtik.solve_ik_many(robot, poses, method=method).found.mean())


def compare(report: Report, name: str, runs: dict[str, Runs], batch: dict[str, tuple[float, float]]) -> None:
    """The acceptance rows of one arm."""
    auto, kernel = runs["auto"], runs[KERNEL]
    share = batch["solve_ik_many, auto"][0]
    least = min(auto.share, share)
    report.bar(f"{name}: `auto` solves, one by one and in a batch", ">= 99.9 %", f"{least:.2%}", least >= 0.999)
    in_batch = batch["solve_ik_many, auto"][1]
    fastest = min((key for key in runs if key in OTHERS), key=lambda key: runs[key].median)
    for other, beside in (
        (fastest, "the fastest numeric method of others"),
        (COMPILED, "roboticstoolbox's compiled one"),
    ):
        if other not in runs:
            continue
        theirs = runs[other].median
        text = f"{auto.median:.0f} us; {other} {theirs:.0f} us"
        report.bar(f"{name}: `auto` single, beside {beside}", "faster", text, auto.median < theirs)
        text = f"{in_batch:.1f} us a pose; {other} {theirs:.0f} us"
        report.bar(f"{name}: `auto` in a batch, beside {beside}", "faster", text, in_batch < theirs)
    if name in KERNEL_BARS:
        bar = KERNEL_BARS[name]
        report.bar(
            f"{name}: the kernel, restarts included, median",
            f"<= {bar:g} us",
            f"{kernel.median:.1f} us",
            kernel.median <= bar,
        )


def _percent(share: float) -> str:
    return "not judged" if np.isnan(share) else f"{share:.1%}"


def main(
    run: Run,
    *,
    poses: int = 1000,
    budget: Annotated[float, Option(help="Seconds a method, seven times as many a peer.")] = 1.2,
) -> Report:
    """Measure."""
    report = run.report("Inverse kinematics beside other libraries")
    missing: list[str] = []
    for name in ARMS:
        robot = rrtik.load_robot(name)
        rng = np.random.default_rng(2)
        wanted = robot.fk_batch(rng.uniform(*robot.finite_range(), (poses, robot.dof)))
        runs, absent = single(robot, wanted, budget, (KERNEL, "auto", *list_methods()))
        batch = batches(robot, wanted)
        missing += absent
        compare(report, name, runs, batch)
        report.table(f"{name}, pose by pose", HEAD, [each.row(method) for method, each in runs.items()])
        rows = [[each, _percent(share), f"{us:.1f}"] for each, (share, us) in batch.items()]
        report.table(f"{name}, {len(wanted)} poses in one call", ["method", "solved", "a pose [us]"], rows)
    solved = f"Solved: inside the limits, at most {METRES:g} m and {RADIANS:g} rad away by Pinocchio's kinematics."
    report.note(
        "How",
        f"{versions(*PACKAGES)}. {solved} Starts: the middle of the limits. EAIK gives all branches without "
        "limits; its first inside them is taken. Peers get the arm as a plain URDF of its joints; "
        "TRAC-IK has 0.1 s by the clock.",
    )
    report.note("Not asked", "\n".join(f"- {line}" for line in missing))
    return report
