"""Convert the plan of a task to a run that the page replays: motions of the arm, and carried objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import listed
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.replanning.record import ReplanRun, joints_of
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.captions import motion_names
from rrtik_ompl.tasks.played import PlayedTask
from rrtik_ompl.viewer.drawing.marks import Mark
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes, node_name
from rrtik_ompl.viewer.subject import Fingers, Showable, ShownPath, Subject, replayed, subject_of, subject_of_run
from rrtik_ompl.world.world import World

TASK = "task"  # name of the planner in a run that shows a task
SAME_PLACE = 1e-9  # [m], and the same for rotation matrices
NO_SHIFT = 1e-9  # the same for a finger on its joint


def subject_asked(
    shown: Showable,
    path: ShownPath | PlayedTask | None,
    run: ReplanRun | None = None,
    before: ShownPath | None = None,
    ghosts: ArrayLike | None = None,
    marks: Sequence[Mark] = (),
) -> Subject:
    """Return the subject of whatever is asked for, a path, a task or a run; the arguments are those of a page.

    Raises:
        InputError: If it does not fit what is shown.
    """
    if isinstance(path, PlayedTask):
        return subject_of_task(shown, path)
    more = listed(marks, "marks")
    return subject_of(shown, path, before, ghosts, more) if run is None else subject_of_run(shown, run)


def subject_of_task(shown: Showable, played: PlayedTask) -> Subject:
    """Return the subject of a task plan: its run, the regions that constrain it, and the motion of the gripper.

    Arm, obstacles and attached objects are those of the plan's own worlds, whatever world it is shown with. An object
    that stays in the same place on a joint throughout is drawn there, all others at their pose in each tick.

    Raises:
        InputError: If the plan does not fit what is shown.
    """
    plan = played.plan
    first = plan.worlds[0]
    kept = _kept(plan)
    places = _places(first, played.waypoints[0])

    loose = [item for item in first.scene.attached if item.name not in kept]
    things: list[Obstacle | AttachedObject] = [*first.scene.obstacles, *loose]
    scene = Scene(
        tuple(
            Obstacle(each.name, each.shape, places[each.name], margin=each.margin, color=each.color) for each in things
        ),
        tuple(item for item in first.scene.attached if item.name in kept),
    )

    return replace(
        replayed(shown, run_of(played)),
        robot=first.robot,
        scene=scene,
        held=played.held,
        fingers=fingers_of(plan, first.robot, played.motions + played.rests),
        verdict=played.judged.verdict,
        contacts=played.judged.contacts,
    )


def run_of(played: PlayedTask) -> ReplanRun:
    """Return the run that shows a plan, tick by tick."""
    plan = played.plan
    robot = plan.worlds[0].robot
    kept = _kept(plan)
    names = motion_names(plan)

    ticks: list[Tick] = []
    for number, q in zip(played.motions.tolist(), played.waypoints, strict=True):
        path = plan.paths[number]
        world = plan.worlds[number]
        text = f"motion {number + 1} of {len(plan.paths)}: {names[number]}"
        poses = {name: pose_row(place) for name, place in _places(world, q).items() if name not in kept}
        ticks.append(Tick(len(ticks) / played.rate, q, "walk", path.waypoints, poses, {}, reason=text))

    return ReplanRun(
        problem=robot.name,
        robot=robot.name,
        joint_names=robot.joint_names,
        planner=TASK,
        seed=0,
        step=1.0,
        rate=played.rate,
        margin=0.0,
        speed_bound=None,
        ticks=ticks,
        outcome="arrived",
        prismatic=joints_of(robot, robot.prismatic),
        continuous=joints_of(robot, robot.continuous),
    )


def _kept(plan: TaskPlan) -> frozenset[str]:
    """Return the names of objects that stay in the same place on a joint in all motions."""
    carried = [_carried(world) for world in plan.worlds]
    return frozenset(
        name
        for name, (joint, place) in carried[0].items()
        if all(
            name in each and each[name][0] == joint and np.allclose(each[name][1], place, rtol=0.0, atol=SAME_PLACE)
            for each in carried
        )
    )


def _carried(world: World) -> dict[str, tuple[int, Matrix]]:
    """Return, for all attached objects, the joint that carries them, and their pose on it, shape (4, 4)."""
    model = world.robot.model
    frames = {item.name: model.frames[model.getFrameId(item.link)] for item in world.scene.attached}
    places = {item.name: frames[item.name].placement * item.pose for item in world.scene.attached}
    return {name: (int(frames[name].parentJoint), place.homogeneous) for name, place in places.items()}


def _places(world: World, q: Vector) -> dict[str, pin.SE3]:
    """Return the poses of obstacles and attached objects."""
    places = {item.name: world.robot.fk(q, item.link) * item.pose for item in world.scene.attached}
    return places | {item.name: item.pose for item in world.scene.at(0.0).obstacles}


def fingers_of(plan: TaskPlan, drawn: Robot, at: Vector) -> Fingers:
    """Return the finger motion of a plan relative to the robot that is drawn; ``at`` as in :class:`Fingers`."""
    nodes = joint_nodes(drawn)
    first = _placements(drawn)
    robots = [world.robot for world in plan.worlds]
    if plan.end is not None and plan.end.robot is not robots[-1]:
        robots.append(plan.end.robot)
    places = [_placements(robot) for robot in robots]

    poses = {}
    for (joint, name), placement in first.items():
        moved = [found[joint, name] * placement.inverse() for found in places]
        if any(np.abs(pin.log6(shift).vector).max() > NO_SHIFT for shift in moved):
            rows = [pose_row(shift) for shift in moved]
            poses[nodes[joint], node_name(name)] = np.array(rows)

    return Fingers(poses, at)


def _placements(robot: Robot) -> dict[tuple[int, str], pin.SE3]:
    """Return the pose of every drawn body on its joint, by the joint's number and the body's name."""
    bodies = (robot.visual if robot.visual.ngeoms else robot.collision).geometryObjects
    return {(int(body.parentJoint), str(body.name)): body.placement for body in bodies}
