"""What [1, ch. 3] says of TITAN-4: sizes, the eight branches, singular families, the determinant and the ranks."""

from __future__ import annotations

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Row, verdict
from rrtik_bench.tables import Table
from rrtik_ompl.arrays import Matrix
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.robot import Robot

SOURCE = "[1, ch. 3, app. A to C]"
A1, A2, A3, A4, D6 = 0.122, 0.851, 0.483, 0.127, 0.339  # [m]; no lengths are printed: drawings and the headline reach
MOUNT = 0.194  # [m] of the shoulder axis above the mounting face
RIGHT = np.pi / 2
RANKS = {"elbow": 5, "wrist": 5, "shoulder": 5, "elbow and wrist": 4, "shoulder and wrist": 4}  # as claimed
RANK_TOLERANCE = 1e-9
LENGTHS = "no lengths are printed; a1 to a4 measured from the vendor's drawing, d6 fitted to the headline reach"


def sizes(quick: bool) -> list[Row]:
    """Reach and envelope."""
    robot, count = rrtik.load_robot("titan4", limits="envelope"), 20_000 if quick else 300_000
    tip = robot.fk_batch(np.zeros((1, 6)))[0]
    wanted = np.column_stack([[0, 0, 1], [0, -1, 0], [1, 0, 0], [A1 + A2 + A3 + A4 + D6, 0, 0]])
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (count, 6))
    Q[:, 4] = np.where(np.arange(count) % 2 == 0, 0.0, Q[:, 4])  # the extremes have a straight or a bent wrist
    points = robot.fk_batch(Q)[:, :3, 3] - _shoulder(robot)
    for _ in range(3):  # walk on from the extremes, which random postures do not meet
        Q = np.clip(_near_extremes(robot, Q, points), robot.lower, robot.upper)
        points = robot.fk_batch(Q)[:, :3, 3] - _shoulder(robot)
    rear = float(-points[:, 0].min())
    extremes = (
        ("top above the mounting face", 1984.0, float(points[:, 2].max()) + MOUNT),
        ("bottom", -1308.0, float(points[:, 2].min()) + MOUNT),
        ("rear", 1125.0, rear),
        ("horizontal reach", 1922.0, float(np.hypot(points[:, 0], points[:, 1]).max())),
    )
    off = float(np.abs(tip[:3] - wanted).max())
    rows = [
        Row("stretched arm: tip and its axes", "(1.922, 0, 0); z0, -y0, x0", f"off {off:.0e}", verdict(off < 1e-12),
            LENGTHS)
    ]  # fmt: skip
    for name, printed, ours in extremes:
        close = abs(1e3 * ours - printed) <= 20.0
        rows.append(Row(name, f"{printed:.0f} mm", f"{1e3 * ours:.0f} mm", verdict(close), "within 20 mm; envelope"))
    return rows


def _shoulder(robot: Robot) -> Matrix:
    base: Matrix = robot.fk_batch(np.zeros((1, robot.dof)), robot.link_names[0])[0, :3, 3]
    return base


def _near_extremes(robot: Robot, Q: Matrix, points: Matrix) -> Matrix:
    """Postures around those that reach farthest up, down, back and out."""
    reach = np.hypot(points[:, 0], points[:, 1])
    best = [int(np.argmax(score)) for score in (points[:, 2], -points[:, 2], -points[:, 0], reach)]
    rng = np.random.default_rng(1)
    spread = 0.1 * (robot.upper - robot.lower) * rng.normal(size=(2_000, 6)) * rng.uniform(0.0, 1.0, (2_000, 1)) ** 3
    return np.concatenate([Q[k] + spread for k in best])


def branches(quick: bool) -> list[Row]:
    """All branches of random poses."""
    robot, count = rrtik.load_robot("titan4"), 5_000 if quick else 100_000
    rng = np.random.default_rng(0)
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    found = solutions(robot, robot.fk_batch(Q))
    off = np.where(found.real, np.abs(wrapped(found.branches - Q[:, None])).max(axis=2), np.inf).min(axis=1)
    inside = rng.uniform(robot.lower, robot.upper, (count, 6))
    usable = solutions(robot, robot.fk_batch(inside), check=False).valid.sum(axis=1)
    residual, original = float(np.asarray(found.residuals)[found.real].max()), 100.0 * float((off < 1e-8).mean())
    many = f"1 ({100 * np.mean(usable == 1):.0f} %) or 2 ({100 * np.mean(usable == 2):.0f} %), most {usable.max()}"
    number, real = len(form_of(robot).branches), float(found.real.sum(axis=1).mean())
    return [
        Row("branches of a pose", "8", f"{number}, of which real {real:.1f} in the mean", verdict(number == 8),
            "with atan2, and with the second solution of theta1: both are not printed"),
        Row("every branch reaches the pose", "closed form", f"worst residual {residual:.0e}", verdict(residual < 1e-9)),
        Row("the posture itself is among the branches", "implied", f"{original:.2f} %", verdict(original == 100.0)),
        Row("solutions inside the limits", "up to 4", many, verdict(False, bool(usable.max() == 2)),
            "an upper estimate for this arm; planning limits"),
    ]  # fmt: skip


def singular_families(quick: bool) -> list[Row]:
    """Poses with the gripper normal to the arm plane, and with the wrist point on axis 1."""
    robot, count = rrtik.load_robot("titan4"), 2_000 if quick else 10_000
    rows = []
    published = {"wrist": "two solutions, link 4 level", "shoulder": "named", "shoulder and wrist": "not treated"}
    for case, printed in published.items():
        poses = robot.fk_batch(_singular(case, count, np.random.default_rng(2)))
        found = solutions(robot, poses)
        worst = np.where(found.real, np.asarray(found.residuals).max(axis=2), np.inf).min(axis=1)
        share = 100.0 * float((worst < 1e-9).mean())
        rows.append(Row(f"{case}: poses solved below 1e-9", printed, f"{share:.2f} %", verdict(share >= 99.9),
                        "psi or theta1 is free: the nearest value that the arm can reach"))  # fmt: skip
    return rows


def _singular(case: str, count: int, rng: np.random.Generator) -> Matrix:
    """Random singular postures, joint limits aside; the wrist point goes to axis 1 by theta4."""
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    if "wrist" in case:
        Q[:, 4] = rng.choice([-RIGHT, RIGHT], count)
    if "elbow" in case:
        Q[:, 2] = rng.choice([0.0, np.pi], count)
    todo = np.arange(count) if "shoulder" in case else np.arange(0)
    while len(todo):
        Q[todo, 1:3] = rng.uniform(-np.pi, np.pi, (len(todo), 2))
        cosine = -(A1 + A2 * np.cos(Q[todo, 1]) + A3 * np.cos(Q[todo, 1] + Q[todo, 2])) / A4
        psi = np.arccos(np.clip(cosine, -1.0, 1.0))
        Q[todo, 3] = wrapped(psi - Q[todo, 1] - Q[todo, 2])
        todo = todo[np.abs(cosine) > 1.0]
    return Q


def singularities(quick: bool) -> list[Row]:
    """The determinant, and what the vanishing factors cost."""
    robot, count = rrtik.load_robot("titan4"), 200 if quick else 2_000
    rng = np.random.default_rng(3)
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    factors = A2 * A3 * _radius(Q) * np.sin(Q[:, 2]) * np.cos(Q[:, 4])
    off = float(np.abs(np.abs(np.linalg.det(robot.jacobian_batch(Q))) - np.abs(factors)).max())
    straight = _least_singular_value(robot, np.array([0.3, 0.5, -0.9, 0.4, 0.0, 0.2]))
    bent = _least_singular_value(robot, np.array([0.3, 0.5, -0.9, 0.4, RIGHT, 0.2]))
    ranks = {}
    for name, claimed in RANKS.items():
        values = np.linalg.svd(robot.jacobian_batch(_singular(name, count, rng)), compute_uv=False)
        ranks[name] = claimed, sorted(set((values > RANK_TOLERANCE).sum(axis=1).tolist()))
    rows = [
        Row("det J = -a2 a3 j51 sin(theta3) sin(theta5)", "formula", f"off {off:.0e}", verdict(off < 1e-12),
            "theta5 printed as a DH angle: the cosine of the physical one; the sign depends on the order of rows"),
        Row("wrist singularity: link 4 and gripper collinear", "stated", f"smallest singular value {straight:.2f} "
            f"there, {bent:.0e} at theta5 = 90 deg", verdict(straight < 1e-9, bent < 1e-9),
            "contradicts the printed formula: the straight wrist is regular"),
    ]  # fmt: skip
    for name, (claimed, found) in ranks.items():
        reading = "" if found == [claimed] else "one factor or two, one degree of freedom is lost: ranks by SVD"
        rows.append(Row(f"rank, {name}", str(claimed), ", ".join(map(str, found)),
                        verdict(found == [claimed], found == [5]), reading))  # fmt: skip
    return rows


def _radius(Q: Matrix) -> Matrix:
    upper, forearm, last = Q[:, 1], Q[:, 1] + Q[:, 2], Q[:, 1:4].sum(axis=1)
    radius: Matrix = A1 + A2 * np.cos(upper) + A3 * np.cos(forearm) + A4 * np.cos(last)
    return radius


def _least_singular_value(robot: Robot, q: Matrix) -> float:
    return float(np.linalg.svd(robot.jacobian_batch(q[None])[0], compute_uv=False)[-1])


TABLES = (
    Table("titan4-size", "Reach and envelope", "[1, ch. 3]", sizes, 2, 1),
    Table("titan4-branches", "Closed form: eight branches", SOURCE, branches, 1, 1),
    Table("titan4-singular-poses", "Closed form: singular families", SOURCE, singular_families, 1, 1),
    Table("titan4-singularities", "Determinant and ranks", SOURCE, singularities, 1, 1),
)
