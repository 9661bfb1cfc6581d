"""Convert the state of a session to plain values for the page; angles are in degrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.pilot.interlock import STALE_SECONDS
from rrtik_ompl.pilot.postures import named_postures
from rrtik_ompl.pilot.routes.follower import Follower, Track
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.planning.moves.text import spoken_moves
from rrtik_ompl.sensing.scene_from_view import SeenObject


def state_document(session: Session) -> dict[str, Any]:
    """Return the state of a session as a JSON-compatible dictionary, which the page in `pilot/web/page` displays.

    Values that do not exist (no picture yet, no grasp chosen, no route) are None; texts that do not apply are "".
    """
    state = session.state
    known = session.known
    age = session.time - session.state.pictures.time
    return {
        "mode": session.mode,
        "message": session.message,
        "level": session.level.value,
        "alarms": [
            {"at": round(time, 2), "age": round(session.time - time, 1), "text": text} for time, text in state.alarms
        ],
        "fault_of_arm": known.fault,
        "stopped": state.stopped,
        "picture_age": None if not np.isfinite(age) else round(age, 3),
        "stale": bool(age > STALE_SECONDS),
        "selected": state.selected,
        "joints": _joints(session),
        "objects": [_object(seen, session.unseen(seen.object.name)) for seen in session.surroundings.seen],
        "target": session.target,
        "choice": None if state.choice is None else {"type": state.choice[0], "level": state.choice[1]},
        "lamps": [
            {"type": la.type, "level": la.level, "color": la.color, "reason": la.reason} for la in session.lamps()
        ],
        "fault": session.fault(),
        "route": _route(session),
        "range": _joint_range(session),
        "aim": _aim(session),
        "arm_lost": state.arm_lost,
        "arm_fault": state.arm_fault,
        "arm_age": None if session.arm_health is None else round(state.arm_age, 3),
        "arm_health": [
            {"name": each.name, "value": each.value, "unit": each.unit, "ok": each.ok}
            for each in session.arm_health or ()
        ],
        "trouble": known.trouble,
        "unseen": known.unseen,
        "speed": state.speed,
        "gripper": {"closed": state.gripper.closed, "holds": state.holds or state.gripper.fixed},
        "postures": list(named_postures(session.means, state)),
        "driving": session.driving,
    }


def _joints(session: Session) -> list[dict[str, Any]]:
    """Return name, value, desired value, unit and limits of each joint; the limits of a joint without them are None."""
    robot = session.robot
    joints = []
    for k, name in enumerate(robot.joint_names):
        unit = joint_unit(robot.prismatic[k])
        value, shown = reading(float(session.q[k]), unit)
        low = float(robot.lower[k])
        high = float(robot.upper[k])
        endless = not np.isfinite(low) or not np.isfinite(high)
        joint = {
            "name": name,
            "value": value,
            "desired": reading(float(session.state.desired[k]), unit)[0],
            "unit": shown,
            "lower": None if endless else reading(low, unit)[0],
            "upper": None if endless else reading(high, unit)[0],
        }
        joints.append(joint)
    return joints


def _object(seen: SeenObject, unseen: float) -> dict[str, Any]:
    return {
        "name": seen.object.name,
        "graspable": bool(seen.object.grasps),
        "sigma_mm": round(1e3 * seen.position_sigma, 2),
        "unseen": round(unseen, 1),
    }


def _joint_range(session: Session) -> dict[str, Any]:
    """Return the free range of the selected joint, what ends it on either side, and its near-singular intervals.

    Returns:
        ``low`` and ``high`` in displayed units, ``below`` and ``above`` in words, and ``singular`` as a list of
        ``[from, to, name of the case]``.
    """
    unit = joint_unit(session.robot.prismatic[session.state.selected])
    free = session.joint_range()
    low, high = (reading(end, unit)[0] for end in (free.low, free.high))
    singular = [[reading(a, unit)[0], reading(b, unit)[0], case] for a, b, case in free.singular]
    return {"low": low, "high": high, "below": free.below, "above": free.above, "singular": singular}


def _aim(session: Session) -> dict[str, Any]:
    """Return how the tip must move to reach the chosen grasp, or the chosen object if no grasp is chosen.

    Returns:
        ``tip``: the position of the tip in the base frame [m]; ``to``: the name of the goal, "" without one. With a
        goal also ``distance``, ``xyz`` in the base frame, ``ahead`` along the z axis of the tool and ``aside`` across
        it, all in metres, and ``turn_deg``, the angle between the two orientations.
    """
    tip = session.robot.fk(session.q)
    aim: dict[str, Any] = {"tip": np.round(tip.translation, 4).tolist(), "to": ""}
    target_seen = None if session.target is None else session.surroundings.named(session.target)
    if target_seen is None:
        return aim

    choice = session.state.choice
    goal = target_seen.T_base_object if choice is None else target_seen.grasp_pose(*choice)

    offset = goal.translation - tip.translation
    along_tool = float(offset @ tip.rotation[:, 2])
    across_tool = float(np.linalg.norm(offset - along_tool * tip.rotation[:, 2]))

    return aim | {
        "to": target_seen.object.name if choice is None else f"{choice[0]} {choice[1] + 1}",
        "distance": round(float(np.linalg.norm(offset)), 4),
        "xyz": np.round(offset, 4).tolist(),
        "ahead": round(along_tool, 4),
        "aside": round(across_tool, 4),
        "turn_deg": round(float(np.rad2deg(np.linalg.norm(pin.log3(tip.rotation.T @ goal.rotation)))), 1),
    }


def _route(session: Session) -> dict[str, Any] | None:
    """Return the route with its figures, its moves and the progress along it; None without a route.

    A route that moves all joints at once is shown as a single move, whose value is the share of the route that is
    done.
    """
    route = session.route
    follower = session.follower
    if route is None or follower is None:
        return None

    if route.together:
        share = 0.0 if session.progress is None else session.progress.share
        status = "done" if follower.current else "current"
        single_move = {
            "joint": "all joints",
            "from": 0.0,
            "to": share,
            "unit": "",
            "text": "all joints at once",
            "status": status,
            "at": 1.0,
        }
        moves = [single_move]
    else:
        moves = _moves(follower)

    progress = session.progress
    return {
        "moves": moves,
        "together": route.together,
        "grasp_from": 1 if route.together else route.grasp_from,
        "seconds": round(route.seconds, 1),
        "travel": round(reading(route.travel, "rad")[0], 1),
        "clearance_mm": None if not np.isfinite(route.clearance) else round(1e3 * route.clearance, 1),
        "joints": list(route.joints),
        "robustness": round(route.robustness, 2),
        "share": 0.0 if progress is None else progress.share,
        "advice": "" if progress is None else progress.advice,
        "withdrawn": session.state.way.withdrawn or session.known.unseen,
    }


def _moves(follower: Follower | Track) -> list[dict[str, Any]]:
    """Return the moves of a route with their status, and the share `at` of the total travel at which each ends."""
    words = spoken_moves(follower.path)
    ends = np.cumsum([abs(move.change) for move in follower.moves])
    moves: list[dict[str, Any]] = []
    for number, (move, text) in enumerate(zip(follower.moves, words, strict=True)):
        start, unit = reading(move.start, move.unit)
        end, _ = reading(move.end, move.unit)
        shown = {
            "joint": move.joint,
            "from": start,
            "to": end,
            "unit": unit,
            "text": text,
            "status": _status(number, follower.current),
            "at": float(ends[number] / ends[-1]),
        }
        moves.append(shown)
    return moves


def _status(number: int, current: int) -> str:
    if number == current:
        return "current"
    return "done" if number < current else "ahead"
