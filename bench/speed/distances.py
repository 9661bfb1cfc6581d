"""`World.distances` beside Pinocchio's `computeDistances` with coal: times and values; gradients beside differences.

An interrupted run goes on where it was.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.proofs.free_motions import BOXES, arm_among, clutter, wall
from bench.shared.parts import Parts
from bench.shared.run import Run
from bench.speed.machine import machine
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid

STEP = 1e-6  # [rad] of the differences
CELL = 0.02  # [m]
MOST_STEPS = 1000  # of coal's searches
POINTS = 100_000
ROUNDS = 5
EXACTLY = 1e-10  # [m] coal's tolerance where values are compared
SHARE, GRADIENT, VALUE = 0.2, 1e-5, 2e-6  # bars: of coal's time; [m/rad]; [m]

HOW = """Configurations drawn within the limits, asked in one call; the same ones by Pinocchio's `computeDistances` (its
poses, coal's distances, all pairs one after the other) with the bodies of the world, in turns, the least of {rounds}
rounds, processor time. coal gives no gradients; nearest points both give. It has no clouds. Values: all pairs that are
apart, beside coal with a tolerance of 1e-10 m, not timed: with its usual one it is off by up to 2.4 um beside
cylinders, as a minimisation over both solids shows. To coal a mesh is its triangles, and what is wholly inside of one
is apart from it; such pairs, at 0 for us, are counted beside. Gradients: beside central differences of the distances,
with steps of 1e-6 rad, all joints of all pairs that are a millimetre apart or more."""
INSIDE = """Where an arm stands in a cloud or an octree, each point or cell that overlaps it is a solid of its own, and
the depth is that of the deepest. `within=` does not help there, for overlaps are nearer than any range. Of the
configurations the ten with the largest depths, one a call."""

WORLDS: dict[str, Callable[[], rrtik.World]] = {
    "ur5, 30 boxes": lambda: arm_among("ur5", *clutter(BOXES, 0.8, 0.12)),
    "panda, 30 boxes": lambda: arm_among("panda", *clutter(BOXES, 0.8, 0.12)),
    "panda, a rod in its hand": lambda: arm_among("panda", *clutter(BOXES, 0.8, 0.12), held=True),
    "titan4, 30 boxes": lambda: arm_among("titan4", *clutter(BOXES, 1.5, 0.2)),
    "panda, 100,000 points": lambda: arm_among("panda", _cloud()),
    "panda, an octree": lambda: arm_among("panda", _octree()),
}


def _cloud() -> rrtik.Obstacle:
    return rrtik.Obstacle("cloud", rrtik.PointCloud(wall(POINTS), radius=0.01))


def _octree() -> rrtik.Obstacle:
    cells = np.unique(np.floor(wall(POINTS) / CELL), axis=0)
    return rrtik.Obstacle("octree", rrtik.Octree(CELL * (cells + 0.5), np.full(len(cells), CELL)))


@dataclass(frozen=True)
class Measured:
    """What is measured of a world.

    Attributes:
        pairs: Number of pairs.
        all_pairs, nearest, within, one: Time of a configuration [s]: all pairs, the nearest five, all within 0.1 m, and
            all pairs of one configuration a call.
        coal: Time of Pinocchio and coal for all pairs [s]; NaN without them.
        compared: Number of values that are compared.
        off: Largest difference of a value [m].
        inside: Number of pairs of which one is wholly inside of the other.
        gradients: Number of derivatives that are compared.
        wrong: Largest difference of one [m/rad].
        beyond: How many are farther off than 1e-5.
        deep: Times of the configurations that are deepest [s].
    """

    pairs: int
    all_pairs: float
    nearest: float
    within: float
    one: float
    coal: float
    compared: int
    off: float
    inside: int
    gradients: int
    wrong: float
    beyond: int
    deep: list[float]


def distances(name: str, count: int) -> Measured:
    """Measure a world."""
    world = WORLDS[name]()
    rng = np.random.default_rng(48)
    Q = rng.uniform(*world.robot.finite_range(), (count, world.robot.dof))
    found = world.distances(Q)
    few = Q[: 20 if count_of_points(world) else 100]
    calls: list[Callable[[], object]] = [
        lambda: world.distances(Q),
        lambda: world.distances(Q, nearest=5),
        lambda: world.distances(Q, within=0.1),
        lambda: [world.distances(q) for q in few],
    ]
    judge = None if count_of_points(world) else _Peer(world, found.names)
    if judge is not None:
        calls.append(lambda: judge.distances(few))
    rounds = np.array([[_seconds(call) for call in calls] for _ in range(ROUNDS)]).min(axis=0)
    times = (rounds / [count, count, count, *[len(few)] * (len(calls) - 3)]).tolist()

    expected = np.full((0, len(found.names)), np.inf)
    if judge is not None:
        judge.ask(EXACTLY)
        expected = judge.distances(few)
    inside = (expected > 0.0) & (found.values[: len(expected)] == 0.0)
    apart = (expected > 0.0) & ~inside
    off = np.abs(found.values[: len(expected)] - expected)[apart]
    error = _gradient_errors(world, few)[world.distances(few).values > 1e-3]

    deepest = Q[np.argsort(found.values.min(axis=1))[:10]]
    deep = [min(_seconds(lambda q=q: world.distances(q)) for _ in range(3)) for q in deepest]  # type: ignore[misc]
    return Measured(
        pairs=len(found.names),
        all_pairs=times[0],
        nearest=times[1],
        within=times[2],
        one=times[3],
        coal=times[4] if judge is not None else float("nan"),
        compared=off.size,
        off=float(off.max(initial=0.0)),
        inside=int(inside.sum()),
        gradients=error.size,
        wrong=float(error.max(initial=0.0)),
        beyond=int((error > GRADIENT).sum()),
        deep=deep,
    )


def count_of_points(world: rrtik.World) -> int:
    """How many points the clouds of a world have."""
    return sum(len(body.geometry.cloud.points) for body in world.bodies if isinstance(body.geometry, CloudSolid))


class _Peer:
    """Pinocchio and coal, with the bodies of a world and pairs of names."""

    def __init__(self, world: rrtik.World, names: tuple[tuple[str, str], ...]) -> None:
        self._robot = world.robot
        self._data = world.robot.model.createData()
        self._geometry = pin.GeometryModel()
        for number, body in enumerate(world.bodies):
            item = pin.GeometryObject(f"{body.name} {number}", body.joint, body.placement, body.geometry)
            self._geometry.addGeometryObject(item)
        self._columns = []
        for i, j in world.pairs:
            pair = world.bodies[i].name, world.bodies[j].name
            if pair in names:
                self._geometry.addCollisionPair(pin.CollisionPair(i, j))
                self._columns.append(names.index(pair))
        self._found = pin.GeometryData(self._geometry)
        self._count = len(names)

    def ask(self, tolerance: float) -> None:
        """Let coal's searches go on until they are as near as this [m]."""
        for request in self._found.distanceRequests:
            request.gjk_tolerance = tolerance
            request.gjk_max_iterations = MOST_STEPS

    def distances(self, Q: Matrix) -> Matrix:
        """The least distance of each pair, shape (m, pairs)."""
        values = np.full((len(Q), self._count), np.inf)
        for k, row in enumerate(self._robot.pinocchio_configuration(Q)):
            pin.computeDistances(self._robot.model, self._data, self._geometry, self._found, row)
            got = [result.min_distance for result in self._found.distanceResults]
            np.minimum.at(values[k], self._columns, got)
        return values


def _gradient_errors(world: rrtik.World, Q: Matrix) -> np.ndarray:
    """Differences of derivatives from central differences of the distances, shape (m, pairs, dof)."""
    dof = world.robot.dof
    steps = STEP * np.concatenate([np.eye(dof), -np.eye(dof)])
    moved = world.distances((Q[:, None] + steps).reshape(-1, dof)).values.reshape(len(Q), 2, dof, -1)
    return np.abs((moved[:, 0] - moved[:, 1]).swapaxes(1, 2) / (2.0 * STEP) - world.distances(Q).gradients)


def _seconds(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def fill(report: Report, found: dict[str, Measured]) -> None:
    """The acceptance rows and the tables."""
    judged = {name: each for name, each in found.items() if np.isfinite(each.coal)}
    shares = {name: each.all_pairs / each.coal for name, each in judged.items()}
    report.bar("time of all pairs over coal's", f"<= {SHARE:g}", ", ".join(f"{n} {s:.2g}" for n, s in shares.items()),
               max(shares.values()) <= SHARE)  # fmt: skip
    off = max(each.off for each in judged.values())
    report.bar("values beside coal's, where apart", "<= 2 um", f"{1e6 * off:.2g} um", off <= VALUE)
    beyond = sum(each.beyond for each in found.values())
    total = sum(each.gradients for each in found.values())
    wrong = max(each.wrong for each in found.values())
    report.bar("derivatives beside differences", f"<= {GRADIENT:g}", f"{wrong:.2g} (of {total}, {beyond} are beyond)",
               beyond == 0)  # fmt: skip
    rows = [
        [name, f"{each.pairs}", *(f"{1e6 * t:.3g}" for t in (each.all_pairs, each.nearest, each.within, each.one)),
         *([f"{1e6 * each.coal:.3g}", f"{shares[name]:.2g}"] if name in judged else ["-", "-"]),
         f"{each.compared}", f"{1e6 * each.off:.2g}", f"{each.inside}", f"{each.gradients}", f"{each.wrong:.2g}"]
        for name, each in found.items()
    ]  # fmt: skip
    heads = ["", "pairs", "all pairs", "the nearest 5", "within 0.1 m", "one a call", "coal", "all pairs over coal"]
    heads += ["values compared", "off, at most [um]", "inside", "derivatives compared", "off, at most"]
    report.table("Microseconds a configuration", heads, rows, text=HOW.format(rounds=ROUNDS))
    cells = [
        [name, f"{1e3 * np.median(each.deep):.2g}", f"{1e3 * max(each.deep):.2g}", f"{1e3 * each.all_pairs:.2g}"]
        for name, each in found.items()
    ]
    heads = ["", "deep inside, median [ms]", "most [ms]", "all configurations, mean [ms]"]
    report.table("Deep inside", heads, cells, text=INSIDE)


def main(run: Run, parts: Parts, *, count: Annotated[int, Option(help="Configurations a batch.")] = 1000) -> Report:
    """Measure."""
    found = dict(zip(WORLDS, parts(distances, [(name, count) for name in WORLDS]), strict=True))
    report = run.report("Distances for optimisers")
    fill(report, found)
    report.note("Machine", machine())
    return report
