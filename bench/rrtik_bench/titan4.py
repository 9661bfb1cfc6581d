"""What [1, ch. 3] says of TITAN-4: sizes, the eight branches, singular families, the determinant and the ranks."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import INFINITE, Bar, Row, about, all_of, exactly, judged, small
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.model.robot import Robot
from rrtik_robots.titan4.singular_samples import singular_configurations

SOURCE = "[1, ch. 3, app. A to C]"
A1, A2, A3, A4, D6 = 0.122, 0.851, 0.483, 0.127, 0.339  # [m]; no lengths are printed: drawings and the headline reach
MOUNT = 0.194  # [m] of the shoulder axis above the mounting face
RIGHT = np.pi / 2
RANKS = {  # as claimed: each family that is active costs one degree of freedom
    "elbow": 5,
    "wrist": 5,
    "shoulder": 5,
    "elbow and wrist": 4,
    "elbow and shoulder": 4,
    "shoulder and wrist": 4,
    "elbow, shoulder and wrist": 3,
}
RANK_TOLERANCE = 1e-9
BESIDE = tuple(10.0**power for power in range(-12, -3))  # [rad]
LOST = "families together cost one degree of freedom, as each alone does"
FREE = "psi or theta1 is free: the nearest value that the arm can reach"
LENGTHS = "no lengths are printed; a1 to a4 measured from the vendor's drawing, d6 fitted to the headline reach"


def sizes(quick: bool) -> list[Row]:
    """Reach and envelope."""
    robot, count = rrtik.load_robot("titan4", parameters={"limits": "envelope"}), 20_000 if quick else 300_000
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
        judged("stretched arm: tip and its axes", "(1.922, 0, 0); z0, -y0, x0", f"off {off:.0e}", off, small(1e-12),
               LENGTHS)
    ]  # fmt: skip
    for name, printed, ours in extremes:
        bar = Bar((-3000.0, 3000.0), held=about(printed, 20.0))
        text = f"{1e3 * ours:.0f} mm"
        rows.append(judged(name, f"{printed:.0f} mm", text, 1e3 * ours, bar, "within 20 mm; limits of the envelope"))
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
        judged("branches of a pose", "8", f"{number}, of which real {real:.1f} in the mean", number, exactly(8, 16),
               "with atan2, and with the second solution of theta1: both are not printed"),
        judged("every branch reaches the pose", "closed form", f"worst residual {residual:.0e}", residual, small(1e-9)),
        judged("the posture itself is among the branches", "implied", f"{original:.2f} %", 0.01 * original, all_of()),
        judged("solutions inside the limits", "up to 4", many, int(usable.max()),
               Bar((0.0, 8.0), held=(4.0, 4.0), differs=(1.0, 3.0)), "an upper estimate for this arm; planning limits"),
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
        rows.append(judged(f"{case}: poses solved below 1e-9", printed, f"{share:.2f} %", share,
                           Bar((0.0, 100.0), held=(99.9, 100.0)), f"{FREE}, limits of joints left aside"))  # fmt: skip
        rows.append(_inside_limits(robot, case, 20 if quick else 500))
    return rows


def beside_singular(quick: bool) -> list[Row]:
    """Poses of postures that are singular but for a little, where the digits of a closed form are lost."""
    robot = rrtik.load_robot("titan4")
    rng = np.random.default_rng(6)
    count = 20 if quick else 100
    rows = []
    for case in ("wrist", "elbow wrist", "shoulder", "shoulder wrist", "all psi"):
        worst = 0.0
        found = 0
        for away in BESIDE:
            for pose in robot.fk_batch(_beside(robot, case, away, count, rng)):
                answer = rrtik.solve_ik(robot, rrtik.PoseGoal(pin.SE3(pose)), method="closed-form")
                found += answer.found
                worst = max(worst, float(answer.residuals.max())) if answer.found else np.nan
        told = f"{found} of {count * len(BESIDE)}, worst residual {worst:.0e}"
        name = f"{case}: {BESIDE[0]:g} to {BESIDE[-1]:g} rad beside"
        rows.append(judged(name, "not treated", told, worst, small(1e-9), "branches led to the pose inside the limits"))
    return rows


def _beside(robot: Robot, case: str, away: float, count: int, rng: np.random.Generator) -> Matrix:
    """Postures inside the limits, shape (count, 6), up to ``away`` [rad] off those of a singular case in each joint."""
    kept = np.empty((0, robot.dof))
    while len(kept) < count:
        Q = singular_configurations(case, 2_000, rng) + rng.uniform(-away, away, (2_000, robot.dof))
        kept = np.vstack([kept, Q[robot.within_limits(Q, 0.0)]])
    return kept[:count]


def _inside_limits(robot: Robot, case: str, count: int) -> Row:
    """Singular poses of postures inside the limits, by `solve_ik`."""
    rng, kept = np.random.default_rng(4), np.empty((0, robot.dof))
    while len(kept) < count:
        Q = _singular(case, 2_000, rng)
        Q[:, [0, 5]] = rng.uniform(robot.lower[[0, 5]], robot.upper[[0, 5]], (len(Q), 2))
        kept = np.vstack([kept, Q[((robot.lower <= Q) & (robot.upper >= Q)).all(axis=1)]])
    poses = robot.fk_batch(kept[:count])
    answers = [rrtik.solve_ik(robot, rrtik.PoseGoal(pin.SE3(pose))) for pose in poses]
    solved = [answer.found for answer in answers]
    off = np.array([
        np.abs(robot.fk_batch(answer.solutions[:1])[0] - pose).max() if answer.found else np.nan
        for answer, pose in zip(answers, poses, strict=True)
    ])  # fmt: skip
    worst = float(off.max())
    return judged(f"{case}: poses of postures inside the limits, by solve_ik", "not treated",
                  f"{sum(solved)} of {count}, worst residual {worst:.0e}", worst, small(1e-9), FREE)  # fmt: skip


def _singular(case: str, count: int, rng: np.random.Generator) -> Matrix:
    """Random singular postures, joint limits aside; the wrist point goes to axis 1 by theta4."""
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    if "wrist" in case:
        Q[:, 4] = rng.choice([-RIGHT, RIGHT], count)
    if "elbow" in case:
        Q[:, 2] = rng.choice([0.0, np.pi], count)
    todo = np.arange(count) if "shoulder" in case else np.arange(0)
    while len(todo):
        Q[todo, 1] = rng.uniform(-np.pi, np.pi, len(todo))
        if "elbow" not in case:
            Q[todo, 2] = rng.uniform(-np.pi, np.pi, len(todo))
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
        judged("det J = -a2 a3 j51 sin(theta3) sin(theta5)", "formula", f"off {off:.0e}", off, small(1e-12),
               "theta5 printed as a DH angle: the cosine of the physical one; the sign depends on the order of rows"),
        judged("wrist singularity: link 4 and gripper collinear", "stated", f"smallest singular value {straight:.2f} "
               f"there, {bent:.0e} at theta5 = 90 deg", straight if bent < RANK_TOLERANCE else np.nan,
               Bar((0.0, INFINITE), held=(0.0, RANK_TOLERANCE), refuted=(1e-3, 2.0)),
               "contradicts the printed formula: the straight wrist is regular"),
    ]  # fmt: skip
    for name, (claimed, found) in ranks.items():
        reading = "" if found == [claimed] else f"{len(Q)} postures, ranks by SVD: {LOST}"
        bar = Bar((0.0, 6.0), held=(claimed, claimed), refuted=(5.0, 5.0) if claimed < 5 else None)
        one = found[0] if len(found) == 1 else np.nan
        rows.append(judged(f"rank, {name}", str(claimed), ", ".join(map(str, found)), one, bar, reading))
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
    Table("titan4-beside-singular", "Closed form: beside singular families", SOURCE, beside_singular, 20, 2),
    Table("titan4-singularities", "Determinant and ranks", SOURCE, singularities, 1, 1),
)
