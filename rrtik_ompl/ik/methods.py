"""The methods of inverse kinematics behind one face, the preferred ones first, and which goals each fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.choices import IkMethod
from rrtik_ompl.fast.ik import branch_layout, ik_layout
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.goal import PositionGoal, tolerances
from rrtik_ompl.ik.analytic.closed_form import branches_of, family, form_of, has_closed_form
from rrtik_ompl.ik.analytic.kernel_branches import valid_branches
from rrtik_ompl.ik.analytic.reference_branches import tip_fault
from rrtik_ompl.ik.baselines.ccd import ccd
from rrtik_ompl.ik.baselines.damped import damped_least_squares, pinocchio_iteration
from rrtik_ompl.ik.baselines.fabrik import fabrik, fabrik_misfit
from rrtik_ompl.ik.baselines.joint_axes import coupled_fault
from rrtik_ompl.ik.baselines.pso import PARTICLES, pso, resampled_pso
from rrtik_ompl.ik.genetic.method import genetic
from rrtik_ompl.ik.mb_rrt.method import mb_rrt, mb_rrt_misfit
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, Method, Target
from rrtik_ompl.ik.numeric.levenberg_marquardt import numeric
from rrtik_ompl.ik.numeric.projection import projection
from rrtik_ompl.ik.numeric.restarts import MAX_ROUNDS, STARTS, Walk, restarted
from rrtik_ompl.robot import Robot

SUFFICIENT_STARTS = 4  # starts that arrive before the others of a round are given up


def load_kernels(robot: Robot) -> None:
    """Load what the methods may call before the clock starts: to compile it the first time is no part of a search."""
    library(ik_layout.KERNELS)
    if has_closed_form(robot) and form_of(robot).kernel:
        library(branch_layout.KERNELS)


def _closed_form_misfit(robot: Robot, target: Target) -> str:
    if not has_closed_form(robot):
        return "the robot brings no closed form"
    if form_of(robot).kind == "pose" and isinstance(target, PositionGoal):
        return "its closed form needs a pose, and a position leaves a whole family of solutions"
    return tip_fault(robot, form_of(robot))


def _closed_form(request: IkRequest) -> IkResponse:
    """All branches of all targets; if none will do, the curves of those that are singular within their tolerances."""
    robot, targets = request.robot, request.targets
    q = valid_branches(robot, form_of(robot), _matrix(targets[0]), request.near) if len(targets) == 1 else None
    if q is None:
        found = branches_of(robot, *_poses_and_hints(request), check=False)
        q = found.branches[found.valid]
    if len(q) and request.accept(q).any():  # the usual case; forward kinematics checks what is returned
        return IkResponse(q, request.near)
    found = branches_of(robot, *_poses_and_hints(request))
    rows, owner = found.branches.reshape(-1, robot.dof), np.repeat(np.arange(len(targets)), found.real.shape[1])
    residuals = np.asarray(found.residuals).reshape(-1, 2)
    near_enough = residuals <= np.array([tolerances(target) for target in targets])[owner]
    reaching = near_enough.all(axis=1)
    q = rows[robot.within_limits(rows) & reaching]
    if not request.accept(q).any():
        q = np.vstack([q, *(family(robot, _matrix(target), slack=_slack(target)) for target in targets)])
    outside = np.maximum(robot.lower - rows, rows - robot.upper).max(axis=1)
    best = np.argmin(np.where(reaching, outside, np.inf) if reaching.any() else residuals.sum(axis=1))
    return IkResponse(q, rows[int(best)], singular=leaves_a_curve(robot, targets))


def _poses_and_hints(request: IkRequest) -> tuple[NDArray[np.float64], Matrix]:
    """Of all targets, shapes (m, 4, 4) and (m, dof)."""
    return np.array([_matrix(target) for target in request.targets]), np.array([request.near] * len(request.targets))


def leaves_a_curve(robot: Robot, targets: Sequence[Target]) -> bool:
    """Whether any target of a closed form is singular within its tolerances, and so has a curve of solutions."""
    poses = np.array([_matrix(target) for target in targets])
    found = branches_of(robot, poses, slack=min(map(_slack, targets)), check=False)
    return bool(((found.singular > 0) & found.real.any(axis=1)).any())


def _slack(target: Target) -> float:
    """How far from singular a target may be to be treated as singular: a part of its tolerances [m, rad]."""
    if isinstance(target, PositionGoal):
        return 0.0
    return 0.4 * min(target.position_tolerance, target.orientation_tolerance)


def _matrix(target: Target) -> Matrix:
    if not isinstance(target, PositionGoal):
        return np.asarray(target.T_world_tip.homogeneous, dtype=np.float64)
    matrix: Matrix = np.eye(4)
    matrix[:3, 3] = target.position
    return matrix


def _walks(walk: Walk, starts: int = STARTS, rounds: int = MAX_ROUNDS) -> Callable[[IkRequest], IkResponse]:
    return partial(restarted, walk, starts=starts, rounds=rounds)


def _fits_all(robot: Robot, target: Target) -> str:
    del robot, target
    return ""


def _uncoupled(robot: Robot, target: Target) -> str:
    del target
    return coupled_fault(robot)


METHODS: Mapping[IkMethod, Method] = MappingProxyType(
    {
        "closed-form": Method(_closed_form_misfit, _closed_form),
        "numeric": Method(_fits_all, numeric),
        "genetic": Method(_fits_all, genetic),
        "mb-rrt": Method(mb_rrt_misfit, mb_rrt),
        "projection": Method(_fits_all, projection),
        "damped": Method(_fits_all, _walks(partial(damped_least_squares, enough=SUFFICIENT_STARTS))),
        "pinocchio": Method(_fits_all, _walks(pinocchio_iteration, starts=1, rounds=64)),
        "ccd": Method(_uncoupled, _walks(partial(ccd, enough=SUFFICIENT_STARTS))),
        "fabrik": Method(fabrik_misfit, _walks(partial(fabrik, enough=SUFFICIENT_STARTS))),
        "pso": Method(_fits_all, _walks(pso, starts=4 * PARTICLES)),
        "pso-resampled": Method(_fits_all, _walks(resampled_pso, starts=4 * PARTICLES)),
    }
)
