"""The tips by which a person drags an arm in a page, and how the page finds them on the arm."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.robot import Robot

OWN_JOINTS = 3  # of a branch that can be dragged; fewer are fingers
DIGITS = 9


def tip_entry(robot: Robot, name: str) -> dict[str, Any]:
    """A tip for the page: its name, the number of the joint that carries it (0: none), its pose on that."""
    tip = robot.model.frames[robot.model.getFrameId(name)]
    placement = (np.round(tip.placement.homogeneous.ravel(), DIGITS) + 0.0).tolist()
    return {"name": name, "joint": int(tip.parentJoint), "placement": placement}


def dragged_tips(robot: Robot, goal: Goal | None) -> list[str]:
    """Links by which a person can drag the arm: the robot's tip first, those of a goal for several, ends of other arms.

    Args:
        robot: The arm.
        goal: Of the problem.
    """
    named = () if goal is None else goal.frames
    tips = list(dict.fromkeys([robot.tip, *named]))
    carried = {row for tip in tips for row in _rows(robot, tip_entry(robot, tip)["joint"] - 1)}

    # Rows that are nobody's parent are the ends of the tree's branches.
    for row in sorted(set(range(len(robot.chain.parent))) - set(robot.chain.parent.tolist())):
        own = set(_rows(robot, row)) - carried
        frames = [f for f in robot.model.frames if f.parentJoint == row + 1 and f.type == pin.FrameType.BODY]
        if frames and np.count_nonzero(np.any(robot.chain.gain[sorted(own)] != 0.0, axis=0)) >= OWN_JOINTS:
            tips.append(min(frames, key=partial(_unlike, robot.model.frames[robot.model.getFrameId(robot.tip)])).name)
            carried |= own

    return tips


def _unlike(tip: pin.Frame, frame: pin.Frame) -> float:
    """How much the place of a link on its joint differs from that of the robot's tip."""
    return float(np.abs(frame.placement.homogeneous - tip.placement.homogeneous).max())


def _rows(robot: Robot, row: int) -> list[int]:
    """The joints from one to the base, as rows of the chain."""
    rows = []
    while row >= 0:
        rows.append(row)
        row = int(robot.chain.parent[row])
    return rows
