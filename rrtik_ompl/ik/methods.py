"""The methods of inverse kinematics behind one interface, the preferred ones first, and the goals that each fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.ik.analytic.branches import tip_fault, valid_branches
from rrtik_ompl.ik.analytic.closed_form import branches_of, family, form_of, has_closed_form
from rrtik_ompl.ik.method_interface import EXACT, SLACK_SHARE, IkRequest, IkResponse, Method, fits_all
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.numeric.projection import projection
from rrtik_ompl.ik.numeric.restarts import numeric
from rrtik_ompl.kernels.ik import branch_layout, ik_layout, near_layout, pose_layout
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, inside_limits

TINY = 1e-300  # in place of the tolerance 0 of an angle that does not count
LEADING = 20  # steps from a configuration within the tolerances of a target to the target itself


def load_kernels(robot: Robot) -> None:
    """Load the kernels that the methods may call, so that compiling them is not counted as time of a search."""
    library(ik_layout.KERNELS)
    library(pose_layout.KERNELS)
    library(near_layout.KERNELS)
    if has_closed_form(robot) and form_of(robot).kernel:
        library(branch_layout.KERNELS)


def _closed_form_misfit(robot: Robot, target: Target) -> str:
    """Return why the closed form does not fit a robot and a target; "" if it does."""
    if not has_closed_form(robot):
        return "the robot brings no closed form"
    if form_of(robot).kind == "pose" and not target.oriented:
        return "its closed form needs a pose, and a position leaves a whole family of solutions"
    return tip_fault(robot, form_of(robot))


def _closed_form(request: IkRequest) -> IkResponse:
    """Solve a request by the closed form.

    First all branches inside the limits are taken, and if one is accepted, they are the answer; if a single one is
    wanted, branches that have to be moved onto a limit count only where no other will do. Otherwise forward kinematics
    finds the branches that are at a goal only within its tolerances, and targets that are singular within their
    tolerances bring samples of their whole curve of solutions; all these are led nearer to the goal by steps of
    Levenberg-Marquardt. If there is nothing at all, the branch that misses least, by limits or else by distance, is the
    nearest configuration.
    """
    robot = request.robot
    targets = request.targets
    q = None
    if len(targets) == 1:
        q = valid_branches(robot, form_of(robot), _matrix(targets[0]), request.near)
        aims = np.zeros(0 if q is None else len(q), dtype=np.int64)
    are_regular = q is not None
    if q is None:
        found = branches_of(robot, *_poses_and_hints(request), check=False)
        q = found.branches[found.valid]
        aims = found.valid.nonzero()[0]

    if are_regular and inside_limits(robot, q, EXACT).all():
        is_exact = np.ones(len(q), dtype=bool)
    else:
        q, is_exact = _led_nearer(robot, targets, aims, robot.clamp(q))
    good = request.accept(q) & is_exact if len(q) else is_exact
    # The usual case; solve_ik() checks the returned rows by forward kinematics.
    if good.any():
        return IkResponse(q if request.all else q[good], request.near)

    # Otherwise forward kinematics shows which branches are at a goal, and which came nearest.
    found = branches_of(robot, *_poses_and_hints(request))
    rows = found.branches.reshape(-1, robot.dof)
    target_of_row = np.repeat(np.arange(len(targets)), found.real.shape[1])
    residuals = np.asarray(found.residuals).reshape(-1, 2)
    within_tolerance = residuals <= np.array([target.tolerances for target in targets])[target_of_row]
    at_goal = within_tolerance.all(axis=1)
    chosen = inside_limits(robot, rows) & at_goal
    curves = [family(robot, _matrix(target), slack=_slack(target)) for target in targets]
    lengths = [len(curve) for curve in curves]
    aims = np.concatenate([target_of_row[chosen], np.repeat(np.arange(len(targets)), lengths)])
    q, is_exact = _led_nearer(robot, targets, aims, robot.clamp(np.vstack([rows[chosen], *curves])))
    if not request.all and request.accept(q[is_exact]).any():
        q = q[is_exact]

    beyond_limits = np.maximum(robot.lower - rows, rows - robot.upper).max(axis=1)
    misses = np.where(at_goal, beyond_limits, np.inf) if at_goal.any() else residuals.sum(axis=1)
    best = np.argmin(misses)
    return IkResponse(q, rows[int(best)], singular=leaves_a_curve(robot, targets))


def _led_nearer(
    robot: Robot, targets: Sequence[Target], aims: NDArray[np.int64], q: Matrix
) -> tuple[Matrix, NDArray[np.bool_]]:
    """Lead rows from within the tolerances of their targets to these themselves, as far as limits allow.

    Args:
        robot: The arm.
        targets: The targets.
        aims: Number of the target of each row, shape (k,).
        q: Rows inside the limits, shape (k, dof).

    Returns:
        Rows, shape (k, dof), and which of them are at the targets themselves, shape (k,).
    """
    nearer = q.copy()
    is_exact = np.zeros(len(q), dtype=bool)
    for number in np.unique(aims):
        target = targets[number]
        (own,) = (aims == number).nonzero()
        is_exact[own] = np.max(target.errors(robot, q[own]), axis=0) <= EXACT
        far = own[~is_exact[own]]
        if len(far) == 0:
            continue

        sharp = target.tightened(EXACT / target.tolerances[0])
        led, _ = descend(robot, sharp, q[far], iterations=LEADING)
        before, after = (np.array(target.errors(robot, rows)) for rows in (q[far], led))
        share = np.maximum(target.tolerances, TINY)[:, None]
        better = (after / share).max(axis=0) < (before / share).max(axis=0)
        nearer[far[better]] = led[better]
        is_exact[far] = better & (after.max(axis=0) <= EXACT)
    return nearer, is_exact


def _poses_and_hints(request: IkRequest) -> tuple[NDArray[np.float64], Matrix]:
    """Return the poses of all targets, shape (m, 4, 4), and the wanted configuration for each, shape (m, dof)."""
    return np.array([_matrix(target) for target in request.targets]), np.array([request.near] * len(request.targets))


def leaves_a_curve(robot: Robot, targets: Sequence[Target]) -> bool:
    """Check whether any target of a closed form is singular within its tolerances, so that it has a solution curve."""
    poses = np.array([_matrix(target) for target in targets])
    found = branches_of(robot, poses, slack=min(map(_slack, targets)), check=False)
    return bool(((found.singular > 0) & found.real.any(axis=1)).any())


def _slack(target: Target) -> float:
    """Return how far from singular a target may be to be treated as singular."""
    return SLACK_SHARE * min(target.tolerances)


def _matrix(target: Target) -> Matrix:
    """Return the pose of a target, shape (4, 4)."""
    return np.asarray(target.pose.homogeneous, dtype=np.float64)


def _genetic(request: IkRequest) -> IkResponse:
    from rrtik_ompl.ik.genetic.search import genetic  # Loaded late, since `plan()` does not need it.

    return genetic(request)


def _mb_rrt_misfit(robot: Robot, target: Target) -> str:
    from rrtik_ompl.ik.mb_rrt.axes import misfit

    del target
    return misfit(robot)


def _mb_rrt(request: IkRequest) -> IkResponse:
    from rrtik_ompl.ik.mb_rrt.search import mb_rrt

    return mb_rrt(request)


def _baseline(name: IkMethod) -> Method:
    """Return a baseline method, whose module is loaded when it is first used."""

    def misfit(robot: Robot, target: Target) -> str:
        from rrtik_ompl.ik.baselines import BASELINES

        return BASELINES[name].misfit(robot, target)

    def run(request: IkRequest) -> IkResponse:
        from rrtik_ompl.ik.baselines import BASELINES

        return BASELINES[name].run(request)

    return Method(misfit, run)


METHODS: Mapping[IkMethod, Method] = MappingProxyType(
    {
        "closed-form": Method(_closed_form_misfit, _closed_form),
        "numeric": Method(fits_all, numeric),
        "genetic": Method(fits_all, _genetic),
        "mb-rrt": Method(_mb_rrt_misfit, _mb_rrt),
        "projection": Method(fits_all, projection),
        "damped": _baseline("damped"),
        "pinocchio": _baseline("pinocchio"),
        "ccd": _baseline("ccd"),
        "fabrik": _baseline("fabrik"),
        "pso": _baseline("pso"),
        "pso-resampled": _baseline("pso-resampled"),
    }
)
