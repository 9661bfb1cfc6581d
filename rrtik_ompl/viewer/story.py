"""Data of the page's panel and player: joints with units, the kinematic chain, the waypoints and their times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.poses import pose_from_xyzw
from rrtik_ompl.base.units import shown_unit
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.judgement import FARTHEST, ClearanceCurve, PathContact, Verdict
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.transitions import moved, route_length, transitions
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.framing import Frame, obstacle_corners, overview
from rrtik_ompl.viewer.drawing.marks import Mark
from rrtik_ompl.viewer.drawing.meshes import look_of_margin
from rrtik_ompl.viewer.drawing.painting import obstacle_colors
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes, node_name, nodes_of
from rrtik_ompl.viewer.drawing.trail import pieces
from rrtik_ompl.viewer.run_story import run_story
from rrtik_ompl.viewer.subject import Subject
from rrtik_ompl.viewer.task_story import TASK

PLAY_SPEED = np.deg2rad(30.0)  # [rad/s]; speed of the joint that travels farthest in a move
PLAY_SECONDS = (3.0, 60.0)  # shortest and longest playing time of a whole path
DIGITS = 9
SEEN_ROWS = 60  # largest number of waypoints of which the first view shows as much as it can
LINK_SHARES = (1 / 3, 2 / 3, 1.0)  # of the way from each joint to the next one, where a link should be seen
OWN_JOINTS = 3  # least number of joints of a branch that can be dragged; shorter branches are fingers


def story_of(subject: Subject, frame: Frame, title: str, name: str = "") -> dict[str, Any]:
    """Return all data that the page's own script reads, as numbers, texts, lists and dicts (to be written as JSON).

    Lengths are in metres and angles in radians; the script converts them to degrees for display. With a ``name`` the
    title follows the path that the page finds.
    """
    robot = subject.robot
    return {
        "title": title,
        "name": name,
        "robot": None if robot is None else _robot(robot, subject.tips),
        "obstacles": _obstacles(subject.scene),
        "moving": subject.run is not None or any(o.motion is not None for o in subject.scene.obstacles),
        "attached": [item.name for item in subject.scene.attached],
        "goal": "" if subject.goal is None else subject.goal.title,
        "start_ghost": _numbers(subject.start),
        "goal_ghost": _numbers(subject.end),
        "ghosts": _ghosts(subject.ghosts),
        "marks": [_mark(mark, number) for number, mark in enumerate(subject.marks)],
        "waypoints": _numbers(subject.waypoints),
        "before": "" if subject.before is None else _compared(subject.before, subject.waypoints),
        "moves": [] if robot is None else _moves(subject.waypoints),
        "times": [] if robot is None else _numbers(_times(subject, robot, frame)),
        "timed": subject.times is not None,
        "proof": None if subject.verdict is None else _proof(subject.verdict),
        "clearance": None if robot is None or subject.curve is None else _clearance(subject.curve),
        "contacts": [] if robot is None else [_contact(contact, robot, subject.scene) for contact in subject.contacts],
        "run": None if subject.run is None or robot is None else run_story(subject.run, robot, subject.scene, frame),
        "fingers": None if subject.fingers is None else subject.fingers.story(),
        "frame": {"low": _numbers(frame.low), "high": _numbers(frame.high), "points": _numbers(frame.points)},
        "overview": _numbers(overview(groups_to_see(subject), subject.scene, frame)),
        "planar": robot is not None and robot.planar,
        "grid": grid_cell(frame.size),
        "colors": _colors(),
    }


def _robot(robot: Robot, tips: Sequence[str]) -> dict[str, Any]:
    """Return the kinematic chain in the form of the page's forward kinematics, and the joints with units and limits."""
    chain = robot.chain
    return {
        "name": robot.name,
        "nodes": joint_nodes(robot),
        "parent": chain.parent.tolist(),
        "placement": _numbers(chain.placement.reshape(-1, 16)),
        "axis": _numbers(chain.axis),
        "prismatic": chain.prismatic.tolist(),
        "gain": _numbers(chain.gain),
        "offset": _numbers(chain.offset),
        "tip": tip_entry(robot, robot.tip),
        "trails": [tip_entry(robot, name) for name in tips],
        "joints": [
            {"name": name, "unit": shown_unit(slides)[1], "lower": _limit(low), "upper": _limit(high)}
            for name, slides, low, high in zip(
                robot.joint_names, robot.prismatic, robot.lower, robot.upper, strict=True
            )
        ],
    }


def _limit(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _obstacles(scene: Scene) -> list[dict[str, Any]]:
    colors = obstacle_colors(scene.obstacles)
    return [
        {
            "name": o.name,
            "node": node_name(o.name),
            "color": colors[o.name],
            "plate": not o.shape.bounded,
            "moving": o.motion is not None,
            "margin": o.margin,
            "margin_drawn": o.margin > 0.0 and look_of_margin(o.shape, o.margin) is not None,
        }
        for o in scene.obstacles
    ]


def _ghosts(rows: Matrix | None) -> list[dict[str, Any]]:
    """Return configurations with a colour each; the colours repeat."""
    colors = palette.SERIES
    return [
        {"name": f"solution {k + 1}", "color": colors[k % len(colors)], "q": _numbers(row)}
        for k, row in enumerate(np.empty((0, 0)) if rows is None else rows)
    ]


def _mark(mark: Mark, number: int) -> dict[str, Any]:
    return {
        "name": mark.name,
        "color": mark.color,
        "opacity": max(mark.opacity, 0.3),
        "node": f"{number}",
        "shown": mark.shown,
    }


def _compared(before: Matrix, after: Matrix) -> str:
    """Compare number of moves and length of two paths in words: "12 moves, length 16.06; now 7, 3.16"."""
    lengths = [f"{route_length(rows):.2f}" for rows in (before, after)]
    return f"{transitions(before)} moves, length {lengths[0]}; now {transitions(after)}, {lengths[1]}"


def _moves(waypoints: Matrix) -> list[dict[str, Any]]:
    """Return, for each move, the numbers of the joints that move, and the piece of the trail to which it belongs."""
    movers = moved(waypoints[:-1], waypoints[1:])
    return [
        {"joints": np.flatnonzero(row).tolist(), "piece": int(piece)}
        for row, piece in zip(movers, pieces(waypoints), strict=True)
    ]


def _times(subject: Subject, robot: Robot, frame: Frame) -> Vector:
    """Return the time at which each waypoint is shown [s]; runs and timed motions have their own times."""
    if subject.times is not None:
        return subject.times
    return play_times(robot, subject.waypoints, frame.arm) if subject.run is None else subject.run.times


def play_times(robot: Robot, waypoints: Matrix, arm: float) -> Vector:
    """Return the time at which the page shows each waypoint [s], shape (k,).

    A move takes as long as its farthest travelling joint needs. These times are for display, not for execution:
    revolute joints move at 30 deg/s, prismatic joints cross the arm's box in 6 s, and a whole path that would be
    shorter than 3 s or longer than 60 s is slowed down or sped up.

    Args:
        robot: The arm.
        waypoints: Shape (k, dof).
        arm: Diagonal of the box around the arm's configurations [m].
    """
    speed = _speeds(robot, arm)
    seconds = (np.abs(np.diff(waypoints, axis=0)) / speed).max(axis=1, initial=0.0)
    total = float(seconds.sum())
    if total > 0.0:
        seconds *= np.clip(total, *PLAY_SECONDS) / total

    return np.concatenate([[0.0], np.cumsum(seconds)])


def play_pace(robot: Robot, arm: float) -> dict[str, Any]:
    """Return the parameters of :func:`play_times` for paths that the page finds itself, and the arm's real rates."""
    speeds = _speeds(robot, arm)
    rates = np.where(np.isfinite(robot.velocity), robot.velocity, speeds)
    return {"speeds": speeds.tolist(), "rates": rates.tolist(), "seconds": list(PLAY_SECONDS)}


def _speeds(robot: Robot, arm: float) -> Vector:
    """Return the display speed of each joint, shape (dof,) [rad/s or m/s]."""
    return np.where(robot.prismatic, arm / 6.0, PLAY_SPEED)


def _proof(verdict: Verdict) -> dict[str, Any]:
    """Return what is proven, and the numbers of unproven moves; a doubt names their colour, ``palette.UNPROVEN``."""
    text = f"{verdict.doubt} (violet){verdict.text}" if verdict.doubt else verdict.text
    return {"proven": verdict.proven, "text": text, "unproven": list(verdict.unproven)}


def _clearance(curve: ClearanceCurve) -> dict[str, Any]:
    """Return the clearance curve: places as motion and share of it, and distances, null where too far to matter."""
    near = curve.distances < FARTHEST
    return {
        "motions": curve.motions.tolist(),
        "shares": _numbers(curve.shares),
        "distances": [round(d, DIGITS) if ok else None for d, ok in zip(curve.distances.tolist(), near, strict=True)],
        "pairs": [list(pair) for pair in curve.pairs],
        "least": curve.least,
    }


def _contact(contact: PathContact, robot: Robot, scene: Scene) -> dict[str, Any]:
    """Return an interval of the path with contact: nodes to draw in red, a text, and the point if it is known."""
    deepest = contact.deepest
    point = 0.5 * (deepest.point_first + deepest.point_second)

    return {
        "begin": contact.begin,
        "end": contact.end,
        "nodes": nodes_of(robot, scene, contact.names),
        "text": str(deepest),
        "point": _numbers(point) if np.isfinite(point).all() else None,
    }


def groups_to_see(subject: Subject) -> list[Matrix]:
    """Return what the first view should not hide, arrays of shape (m, 3).

    These are points of the links and of the tip along the path, the tip at the start and at the end, and first and last
    places of what a task moves.
    """
    if subject.robot is None:
        return []
    rows = subject.waypoints[:: -(-len(subject.waypoints) // SEEN_ROWS)]
    joints = subject.robot.joint_frames(rows)[:, :, :3, 3]
    before = joints[:, list(subject.robot.model.parents[1:])]
    links = np.concatenate([before + share * (joints[:, 1:] - before) for share in LINK_SHARES]).reshape(-1, 3)
    tips = subject.robot.fk_batch(rows)[:, :3, 3]
    groups = [np.concatenate([links, tips]), tips[:1]]

    if subject.end is not None:
        groups.append(subject.robot.fk_batch(subject.end[None])[:, :3, 3])
    if subject.run is not None and subject.run.planner == TASK:
        groups += _moved_things(subject.run, subject.scene)
    return groups


def _moved_things(run: ReplanRun, scene: Scene) -> list[Matrix]:
    """Return the corners of boxes around each thing that moves in a run, where it is first and last, shape (16, 3)."""
    ends = run.ticks[0].poses, run.ticks[-1].poses
    moved_names = [name for name in ends[0] if not np.array_equal(ends[0][name], ends[1][name])]
    groups = []

    for name in moved_names:
        thing = scene.obstacle(name)
        places = [pose_from_xyzw(poses[name][:3], poses[name][3:]) for poses in ends]
        groups.append(np.concatenate([obstacle_corners(replace(thing, pose=place)) for place in places]))
    return groups


def grid_cell(size: float) -> float:
    """Return the width of a grid cell [m]: 1, 2 or 5 times a power of ten, about a fifteenth of ``size`` [m]."""
    power = 10.0 ** np.floor(np.log10(size / 15.0))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= size / 15.0))


def _colors() -> dict[str, str]:
    """Return the colours of the palette that the page uses, by their names in lower case."""
    names = (
        "ROBOT",
        "START",
        "GOAL",
        "OBSTACLE",
        "ATTACHED",
        "TRAIL",
        "UNPROVEN",
        "TOUCHING",
        "BEFORE",
        "BACKGROUND_TOP",
        "BACKGROUND_BOTTOM",
        "GRID_MIDDLE",
        "GRID",
        "BACKGROUND_TOP_DARK",
        "BACKGROUND_BOTTOM_DARK",
        "GRID_MIDDLE_DARK",
        "GRID_DARK",
    )
    return {name.lower(): getattr(palette, name) for name in names}


def _numbers(values: NDArray[np.float64] | None) -> list[object] | None:
    if values is None:
        return None
    rounded: list[object] = (np.round(values, DIGITS) + 0.0).tolist()
    return rounded


# --- the tips by which a person drags an arm -------------------------------------------------------------------------


def tip_entry(robot: Robot, name: str) -> dict[str, Any]:
    """Return a tip for the page: its name, the number of the joint that carries it (0: none), and its pose there."""
    tip = robot.model.frames[robot.model.getFrameId(name)]
    return {"name": name, "joint": int(tip.parentJoint), "placement": _numbers(tip.placement.homogeneous.ravel())}


def dragged_tips(robot: Robot, goal: Goal | None) -> list[str]:
    """Return the links by which a user can drag the arm.

    The robot's tip is first, then the tips of a goal for several, then ends of other branches with at least
    `OWN_JOINTS` joints of their own.

    Args:
        robot: The arm.
        goal: Goal of the problem.
    """
    named = () if goal is None else goal.frames
    tips = list(dict.fromkeys([robot.tip, *named]))
    carried = {row for tip in tips for row in _rows(robot, tip_entry(robot, tip)["joint"] - 1)}

    # Rows that are no parent of others are the ends of the tree's branches.
    for row in sorted(set(range(len(robot.chain.parent))) - set(robot.chain.parent.tolist())):
        own = set(_rows(robot, row)) - carried
        frames = [f for f in robot.model.frames if f.parentJoint == row + 1 and f.type == pin.FrameType.BODY]
        if frames and np.count_nonzero(np.any(robot.chain.gain[sorted(own)] != 0.0, axis=0)) >= OWN_JOINTS:
            tips.append(min(frames, key=partial(_unlike, robot.model.frames[robot.model.getFrameId(robot.tip)])).name)
            carried |= own

    return tips


def _unlike(tip: pin.Frame, frame: pin.Frame) -> float:
    """Return how much the pose of a link on its joint differs from that of the robot's tip."""
    return float(np.abs(frame.placement.homogeneous - tip.placement.homogeneous).max())


def _rows(robot: Robot, row: int) -> list[int]:
    """Return the joints from one to the base, as rows of the chain."""
    rows = []
    while row >= 0:
        rows.append(row)
        row = int(robot.chain.parent[row])
    return rows
