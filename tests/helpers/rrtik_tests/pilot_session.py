"""TITAN-4 before the subsea distribution unit with a valve in view: what the tests of the pilot's tool share."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from rrtik_ompl import load_problem
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.events import Level
from rrtik_ompl.pilot.interlock import MANOEUVRE
from rrtik_ompl.pilot.motion.supervisor import Supervisor
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MountedMarker
from rrtik_ompl.sensing.scene_from_view import SeenObject

PROBLEM = load_problem("titan4_sdu")
ROBOT, WORLD = PROBLEM.robot, PROBLEM.world
VALVE = MarkedObject(
    "valve",
    "target",
    (MountedMarker(7, 0.08),),
    (Obstacle("body", Box([0.02, 0.02, 0.02])),),
    tuple(
        GraspType(name, [pose_from_rpy([0, 0, 0.03 * k], [roll, 0, 0]) for k in range(3)], approach=0.08, lift=0.05)
        for name, roll in (("front", 0.0), ("rolled", np.pi / 2))
    ),
)
PLACE = pin.SE3(ROBOT.fk(PROBLEM.goal.q).rotation, np.array([1.30, 0.17, 0.09]))


# What a command needs, as it was reviewed: the table of the verbs must say the same.
MOVING = ("jog", "go", "next", "servo", "lead", "tool")  # held: the arm moves only as long as they are renewed
PRESENT = (*MOVING, "move", "plan", "replan", "accept", "back", "close", "open", "lift", "together",
           "posture", "keep")  # fmt: skip
GUIDED = ("plan", "replan", "accept", "back", "together", "lift", "next", "servo", "posture")
ALWAYS = (
    "stop",
    "reset",
    "stand",
    "control",
    "release",
    "halt",
    "select",
    "speed",
    "object",
    "grasp",
    "reject",
    "settle",
)


def seen_at(T):
    return SeenObject(VALVE, T, 1e-8 * np.eye(6), None)


def session(record=None):
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, record=record, seed=1)
    made.see([seen_at(PLACE)], 0.0)
    return made, arm


def drive_at(made, rate):
    """Let all joints of a session's arm, which stands still, be driven at another rate [rad/s] than before."""
    rates = np.full(made.robot.dof, rate)
    made.means = replace(made.means, rates=rates)
    made.supervisor = Supervisor(made.robot, rates)
    made.arm._rates = rates


def hold(made, arm, verb, time, until, *, seconds=60.0, step=0.03, **arguments):
    """Hold a command, as a pressed key does, with pictures coming; returns when it was released [s]."""
    end = time + seconds
    while not until() and time < end:
        made.command(verb, time, **arguments)
        arm.advance(step)
        time += step
        made.see([], time)
        made.tick(time)
    made.command("release", time)
    made.tick(time)
    return time


def follow(made, arm, time, most=60):
    """Hold "next" for one move after the other until the list is done; returns when that was [s]."""
    for press in range(most):
        if made.mode != "following":
            return time
        due = made.follower.current
        time = hold(
            made, arm, "next", time, lambda now=due: made.mode != "following" or not still(made, now), press=press
        )
    raise AssertionError("too many moves")


def arrived(made):
    """Whether all moves of a route are made, and the tip is where it ends."""
    return made.mode == MANOEUVRE and made.progress.advice == "done" and made.level is Level.NEWS


def refused(made, *words):
    """Whether the last command was refused, in one line that names some things."""
    return made.level is Level.REFUSAL and "\n" not in made.message and all(word in made.message for word in words)


def alarmed(made, *words):
    """Whether something is said that nobody has commanded, in one line that names some things."""
    return made.level is Level.ALARM and "\n" not in made.message and all(word in made.message for word in words)


def still(made, due):
    """Whether the move that was due is still being made."""
    return made.driving or made.follower.current == due
