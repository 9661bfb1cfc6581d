"""Other libraries' inverse kinematics on our arms: each a function from a pose to a configuration, or why it is absent.

All get the same chain from base to tip, written as a plain URDF or as axes and offsets, and the same start.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.robot import Robot

Solver: TypeAlias = Callable[[np.ndarray], np.ndarray | None]
TURN = 2.0 * np.pi
TRAC_IK_SECONDS = 0.1  # by the clock, so that a busy machine does not count against it; its default is 0.005


def peers(robot: Robot, start: np.ndarray) -> dict[str, Solver | str]:
    """By name what solves for a pose, shape (4, 4), or a line that says why nothing does."""
    return {name: _made(make, robot, start) for name, make in MAKERS.items()}


def _made(make: Callable[[Robot, np.ndarray], Solver], robot: Robot, start: np.ndarray) -> Solver | str:
    try:
        return make(robot, start)
    except ImportError as error:
        return f"not installed ({error})"
    except Exception as error:  # what another library makes of our chain is part of the comparison
        return f"{type(error).__name__}: {error}"


def _trac_ik(robot: Robot, start: np.ndarray) -> Solver:
    from trac_ik import TracIK

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "arm.urdf")
        file.write_text(serial_urdf(robot))
        solver = TracIK("link0", "tip", str(file), timeout=TRAC_IK_SECONDS)
    if solver.dof != robot.dof:
        raise ValueError(f"it sees {solver.dof} joints")

    def solve(pose: np.ndarray) -> np.ndarray | None:
        found = solver.ik(pose[:3, 3], pose[:3, :3], start)
        return None if found is None else np.array(found)

    return solve


def _ikpy(robot: Robot, start: np.ndarray) -> Solver:
    from ikpy.chain import Chain

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "arm.urdf")
        file.write_text(serial_urdf(robot))
        mask = [False, *[True] * robot.dof, False]
        chain = Chain.from_urdf_file(str(file), base_elements=["link0"], active_links_mask=mask)
    first = np.concatenate([[0.0], start, [0.0]])

    def solve(pose: np.ndarray) -> np.ndarray | None:
        found = chain.inverse_kinematics_frame(pose, initial_position=first, orientation_mode="all")
        return np.array(found)[1:-1]

    return solve


def _eaik(robot: Robot, start: np.ndarray) -> Solver:
    solver, at_zero = eaik_robot(robot)

    def solve(pose: np.ndarray) -> np.ndarray | None:
        turned = pose.copy()
        turned[:3, :3] = pose[:3, :3] @ at_zero.T
        answer = solver.IK(turned)
        exact = ~np.array(answer.is_LS, dtype=bool)
        found = turned_inside(robot, np.array(answer.Q).reshape(-1, robot.dof)[exact])
        inside = found[robot.within_limits(found)]
        return inside[0] if len(inside) else None

    return solve


def eaik_robot(robot: Robot) -> tuple[Any, np.ndarray]:
    """EAIK's robot from the axes and offsets at zero, and the rotation of the tip there.

    Raises:
        ImportError: If it is not installed.
        ValueError: If it knows no decomposition of this arm.
    """
    from eaik.IK_HP import HPRobot

    if robot.dof != 6:
        raise ValueError(f"it solves six joints, this arm has {robot.dof}")
    zero = np.zeros((1, robot.dof))
    frames, tip = robot.joint_frames(zero)[0, 1:], robot.fk_batch(zero)[0]
    points = np.vstack([np.zeros(3), frames[:, :3, 3], tip[:3, 3]])
    solver = HPRobot(np.einsum("kij,kj->ki", frames[:, :3, :3], robot.chain.axis), np.diff(points, axis=0))
    if not solver.hasKnownDecomposition():
        raise ValueError("it knows no decomposition of this arm")
    return solver, tip[:3, :3]


def turned_inside(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Angles moved by full turns to the lowest value above the lower limit."""
    low = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    return np.where(robot.prismatic, q, low + (q - low) % TURN)


MAKERS = {"pytracik": _trac_ik, "ikpy": _ikpy, "eaik": _eaik}


def serial_urdf(robot: Robot) -> str:
    """The joints from base to tip as a URDF of its own, ``link0`` to ``tip``; every axis is z."""
    tip = tip_columns(robot)
    if not np.array_equal(tip.gain, np.eye(robot.dof)) or tip.offset.any():
        raise ValueError("coupled joints")
    links = [f"link{k}" for k in range(robot.dof + 1)]
    text = ['<robot name="arm">', *(f'<link name="{name}"/>' for name in (*links, "tip"))]
    for k, (low, high) in enumerate(zip(*robot.finite_range(), strict=True)):
        kind = "prismatic" if tip.prismatic[k] else "revolute"
        text.append(
            f'<joint name="joint{k}" type="{kind}">{_between(links[k], links[k + 1], tip.fixed[k])}'
            f'<axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" velocity="1" effort="1"/></joint>'
        )
    text.append(f'<joint name="last" type="fixed">{_between(links[-1], "tip", tip.fixed[-1])}</joint></robot>')
    return "\n".join(text)


def _between(parent: str, child: str, T: np.ndarray) -> str:
    rpy, xyz = pin.rpy.matrixToRpy(T[:3, :3]), T[:3, 3]
    place = f'xyz="{" ".join(map(repr, map(float, xyz)))}" rpy="{" ".join(map(repr, map(float, rpy)))}"'
    return f'<parent link="{parent}"/><child link="{child}"/><origin {place}/>'
