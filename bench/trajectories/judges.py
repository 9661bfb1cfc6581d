"""What others say to the motions: toppra, ruckig, inverse dynamics, the exact collision check."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from bench.shared.parts import Parts
from bench.trajectories.cases import ARMS, planned
from rrtik_bench.report.page import Report
from rrtik_ompl import RateLimits, load_robot, time_parameterize
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.motion.following.servo import Servo
from rrtik_ompl.motion.trajectory import State, Trajectory
from rrtik_ompl.motion.trajectory.corners import Polyline, first_radii, vertices
from rrtik_ompl.motion.trajectory.curve import Curve
from rrtik_ompl.motion.trajectory.fastest import Bounds, fastest
from rrtik_ompl.motion.trajectory.runs import along_curve, along_lines
from rrtik_ompl.world.world import World

_PANDA = load_robot("panda")
PANDA = RateLimits(_PANDA.velocity, _PANDA.acceleration, _PANDA.jerk)
CURVES, FINE, PROFILES, TWISTS, TORQUE_PATHS = 100, 15, 5000, 1000, 25
SECONDARY = ((0.0, 0.0), (0.2, 0.0), (0.0, 1.0))  # weights of centring and of manipulability
MASS = 3.0  # [kg] in the hand
PLACES = ((0.55, 0.25, 0.5), (0.5, -0.3, 0.45), (0.35, 0, 0.85), (0.75, 0, 0.4), (0, 0.5, 0.6), (0, -0.5, 0.6))
DT = 0.01  # [s] of a step of the steered tip


def by_toppra(report: Report, parts: Parts, files: list[tuple[str, str]]) -> None:
    """Durations of curves through rounded corners beside toppra's on the same grid, and on one of twenty times more."""
    some = files[:: max(1, len(files) // CURVES)]
    fine = {file for _, file in some[:: max(1, len(some) // FINE)]}
    found = [row for row in parts(beside_toppra, [(*file, file[1] in fine) for file in some]) if row is not None]
    search, whole = ([row[k] for row in found] for k in (0, 1))
    fine_ones = [row[2] for row in found if len(row) > 2]
    most = float(np.max(whole))
    report.bar(
        f"duration over toppra's, {len(whole)} curves, same grid", "<= 1.005", f"{most:.4f} at most", most <= 1.005
    )
    rows_ = [
        ["the search alone, same grid", f"{np.median(search):.6f}", f"{np.max(search):.6f}"],
        ["the whole motion, same grid", f"{np.median(whole):.4f}", f"{np.max(whole):.4f}"],
        [
            f"the whole motion, toppra on 20 times the grid ({len(fine_ones)} curves)",
            f"{np.median(fine_ones):.4f}",
            f"{np.max(fine_ones):.4f}",
        ],
    ]
    report.table("Durations over toppra's", ("", "median", "most"), rows_)


def beside_toppra(arm: str, file: str, fine: bool) -> list[float] | None:
    """Durations over toppra's: of the search alone, of the whole motion, and of that over one on a fine grid if asked.

    None where there is no path, or none whose corners can all be rounded.
    """
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    class Path(AbstractGeometricPath):  # type: ignore[misc]
        def __init__(self, curve: Curve) -> None:
            self.curve = curve

        @property
        def dof(self) -> int:
            return int(self.curve.vertices.shape[1])

        @property
        def path_interval(self) -> Vector:
            return np.array([0.0, self.curve.length])

        def __call__(self, places: Vector, order: int = 0) -> Matrix:
            shape = self.curve.at(np.ascontiguousarray(np.atleast_1d(places), dtype=float))
            return (shape.positions, shape.slopes, shape.bends)[order]

    cases = planned(arm, file)
    rows = vertices(cases[0].path.waypoints) if cases else np.empty((0, 0))
    line = Polyline.of(rows)
    radii = first_radii(line, 0.2) if len(rows) > 2 else np.zeros(1)
    if (radii == 0.0).any():
        return None
    curve, limits = Curve.of(line, radii), cases[0].without_jerk
    velocity, acceleration = (np.stack([-row, row], axis=1) for row in (limits.velocity, limits.acceleration))
    rules = [
        JointVelocityConstraint(velocity),
        JointAccelerationConstraint(acceleration, discretization_scheme=DiscretizationType.Interpolation),
    ]

    def theirs(grid: Vector) -> float:
        solver = TOPPRA(rules, Path(curve), gridpoints=grid, solver_wrapper="seidel")
        _, speeds, _ = solver.compute_parameterization(0.0, 0.0)
        return float((2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])).sum())

    grid = curve.grid()[0]
    judged, ours = theirs(grid), along_curve(curve, limits).duration
    free = Bounds.capped(np.full(len(grid), np.inf))
    found = [fastest(grid, curve.at(grid), limits, free).duration / judged, ours / judged]
    return [*found, ours / theirs(np.linspace(0.0, curve.length, 20 * len(grid)))] if fine else found


def by_ruckig(report: Report, parts: Parts) -> None:
    """Durations of straight pieces with jerk limits."""
    (most,) = parts(beside_ruckig, [(PROFILES,)])
    report.bar(f"straight pieces over ruckig's, {PROFILES}", "<= 1.001", f"{most:.6f} at most", most <= 1.001)


def beside_ruckig(profiles: int) -> float:
    """The largest duration of a straight piece over ruckig's."""
    from ruckig import InputParameter, Ruckig
    from ruckig import Trajectory as Profile

    rng, ratios = np.random.default_rng(3), []
    for _ in range(profiles):
        length, v, a, j = np.exp(rng.uniform(np.log([1e-3, 0.05, 0.05, 0.1]), np.log([6.0, 20.0, 20.0, 1e4])))
        task, found = InputParameter(1), Profile(1)
        task.target_position, task.max_velocity, task.max_acceleration, task.max_jerk = [length], [v], [a], [j]
        Ruckig(1).calculate(task, found)
        run = along_lines(Polyline.of(np.array([[0.0], [length]])), RateLimits(v, a, j))
        ratios.append(run.duration / found.duration)
    return float(np.max(ratios))


class Torques(NamedTuple):
    """Largest torques over their limits, one a path.

    Attributes:
        free: Of motions that know no such limit.
        kept: Of those that do.
        refused: How many paths cannot be held still.
    """

    free: list[float]
    kept: list[float]
    refused: int


def by_inverse_dynamics(report: Report, parts: Parts) -> None:
    """Torques with a payload on a dense grid, by Pinocchio."""
    found = parts(torques_of, [(arm, TORQUE_PATHS) for arm in ARMS])
    most = max(max(row.kept) for row in found)
    rows = [
        [arm, str(len(row.kept)), f"{np.median(row.free):.2f}", f"{max(row.kept):.5f}", str(row.refused)]
        for arm, row in zip(ARMS, found, strict=True)
    ]
    count = len(ARMS) * TORQUE_PATHS
    report.bar(f"torque over its limit, 3 kg in the hand, {count} paths", "<= 1.001", f"{most:.5f}", most <= 1.001)
    heads = ("arm", "paths", "without the limit, median", "with it, most", "refused: cannot be held still")
    report.table("Largest torque over its limit", heads, rows)


def torques_of(arm: str, count: int) -> Torques:
    """Random paths of an arm with a payload."""
    rng, robot = np.random.default_rng([5, ARMS.index(arm)]), load_robot(arm)
    world, efforts, found = World(robot), _efforts(robot), Torques([], [], 0)
    low, high = robot.finite_range()
    while len(found.kept) < count:
        path = JointPath.of(robot, rng.uniform(0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high, (4, robot.dof)))
        rest = np.zeros_like(path.waypoints)
        still = np.abs(_torques(robot, State(path.waypoints, rest, rest))).max(axis=0)
        limits = RateLimits.of(robot, acceleration=30.0)
        try:
            bound = np.minimum(efforts, still + 0.15 * efforts)
            motion = time_parameterize(path, limits, blend=0.2, world=world, torque=bound, payload=MASS)
            brisk = time_parameterize(path, limits, blend=0.2, world=world)
        except InputError:
            found = found._replace(refused=found.refused + 1)
            continue
        found.kept.append(float((np.abs(_torques(robot, _dense(motion))) / bound).max()))
        found.free.append(float((np.abs(_torques(robot, _dense(brisk))) / bound).max()))
    return found


def _dense(motion: Trajectory) -> State:
    return motion(np.linspace(0.0, motion.duration, 3000))


def _efforts(robot: Robot) -> Vector:
    places = [robot.model.joints[robot.model.getJointId(name)].idx_v for name in robot.joint_names]
    found: Vector = np.array(robot.model.upperEffortLimit)[places]
    return found


def _torques(robot: Robot, state: State) -> Matrix:
    model = robot.model.copy()
    tip = model.frames[model.getFrameId(robot.tip)]
    model.inertias[tip.parentJoint] += pin.Inertia(MASS, tip.placement.translation, np.zeros((3, 3)))
    data = model.createData()
    q = robot.pinocchio_configuration(state.positions)
    rows = zip(q, state.velocities, state.accelerations, strict=True)
    return np.array([pin.rnea(model, data, *row).copy() for row in rows])


class Steps(NamedTuple):
    """What steering the tip by random twists came to: times of a step [s], contacts, way of the joints [rad]."""

    middle: float
    late: float
    contacts: int
    way: float


def steered(report: Report, parts: Parts) -> None:
    """The steered tip among obstacles: time of a step, contacts by the exact check."""
    found = parts(steps_of, [(*tasks, TWISTS) for tasks in SECONDARY])
    slow, touched = 1e3 * max(row.late for row in found), sum(row.contacts for row in found)
    rows = [
        [
            f"centring {centring:g}, manipulability {manipulability:g}",
            f"{1e3 * row.middle:.3f}",
            f"{1e3 * row.late:.3f}",
            str(row.contacts),
            f"{row.way:.0f}",
        ]
        for (centring, manipulability), row in zip(SECONDARY, found, strict=True)
    ]
    report.bar("Servo.step, 95 % of steps", "<= 0.5 ms", f"{slow:.2f} ms", slow <= 0.5)
    report.bar(f"contacts in {TWISTS} random twists among obstacles, three times", "none", str(touched), touched == 0)
    heads = ("Servo of the Panda among six balls", "median [ms]", "95 % [ms]", "contacts", "way of the joints [rad]")
    report.table("The steered tip", heads, rows, text=f"{TWISTS} twists of 10 steps each.")


def steps_of(centring: float, manipulability: float, twists: int) -> Steps:
    """Random twists of the Panda's tip among six balls."""
    rng, spent, contacts, way = np.random.default_rng(9), list[float](), 0, 0.0
    balls = (Obstacle(f"ball {k}", Sphere(0.08), pin.SE3(np.eye(3), np.array(p))) for k, p in enumerate(PLACES))
    world = World(_PANDA, Scene(tuple(balls)))
    servo, q = Servo(world, centring=centring, manipulability=manipulability), _PANDA.posture("default")
    for _ in range(twists):
        twist = rng.normal(size=6) * [0.4, 0.4, 0.4, 1.0, 1.0, 1.0]
        for _ in range(10):
            begin = time.process_time()
            rates = servo.step(q, twist, DT)
            spent.append(time.process_time() - begin)
            q = q + DT * rates
            way += DT * float(np.linalg.norm(rates))
            contacts += not world.valid(q)
    middle, late = np.percentile(spent, [50, 95]).tolist()
    return Steps(middle, late, contacts, way)
