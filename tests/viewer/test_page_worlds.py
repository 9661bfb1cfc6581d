"""The world of a page at each tick is the world of that motion: what is held, what stands, where the fingers are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import rrtik_ompl as rrtik
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.tasks import Attach, Detach, Gripper, MoveTo, Task, TaskPlan
from rrtik_ompl.viewer.drawing.nodes import Recording
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.story import story_of
from rrtik_ompl.viewer.subject import subject_of, subject_of_run
from rrtik_ompl.viewer.task_story import subject_of_task

pytestmark = pytest.mark.kernels

BOX = "<collision><origin xyz='{0} 0 0'/><geometry><box size='{1} 0.04 0.04'/></geometry></collision>"
JOINT = (
    "<joint name='{0}' type='{1}'><parent link='{2}'/><child link='{3}'/><origin xyz='{4}'/><axis xyz='{5}'/>"
    "<limit lower='{6}' upper='{7}' velocity='1' effort='1'/></joint>"
)
ARM = f"""<robot name="two-handed"><link name="base"/>
<link name="upper">{BOX.format(0.3, 0.5)}</link><link name="hand">{BOX.format(0.1, 0.1)}</link>
<link name="finger">{BOX.format(0.05, 0.1)}</link>
{JOINT.format("turn", "revolute", "base", "upper", "0 0 0", "0 0 1", -3, 3)}
{JOINT.format("bend", "revolute", "upper", "hand", "0.6 0 0", "0 0 1", -2, 2)}
{JOINT.format("grip", "prismatic", "hand", "finger", "0.2 0 0", "1 0 0", 0, 0.1)}</robot>"""
SEMANTICS = """<robot name="two-handed"><group name="arm"><joint name="turn"/><joint name="bend"/></group>
<group name="grip"><joint name="grip"/></group>
<group_state name="open" group="grip"><joint name="grip" value="0.1"/></group_state>
<group_state name="close" group="grip"><joint name="grip" value="0"/></group_state>
<end_effector name="hand" parent_link="hand" group="grip"/></robot>"""
REST = rrtik.pose([0.9, 0.3, 0.4])  # of a cup out of the arm's way
GRASP = pose_from_rpy([0.1, 0.0, 0.3], [0.1, 0.2, 0.3])
A, B, C = [0.5, 0.3], [-0.8, 0.9], [1.2, -0.4]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> rrtik.Robot:
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.urdf").write_text(ARM)
    (folder / "arm.srdf").write_text(SEMANTICS)
    return rrtik.load_robot(
        folder / "arm.urdf", srdf=folder / "arm.srdf", joints=["turn", "bend"], tip="hand", locked={"grip": 0.1}
    )


def scene(held_by: str | None) -> rrtik.Scene:
    """A cup with a margin that stands, or that a link holds, beside a post and a lamp in the upper arm's hand."""
    cup = rrtik.Sphere(0.03)
    post = rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 0.1]), rrtik.pose([0.0, 0.0, 1.5]))
    lamp = rrtik.AttachedObject("lamp", "upper", rrtik.Sphere(0.02), rrtik.pose([0.2, 0.0, 0.2]))
    if held_by is None:
        return rrtik.Scene([post, rrtik.Obstacle("cup", cup, REST, margin=0.01)], [lamp])
    return rrtik.Scene([post], [lamp, rrtik.AttachedObject("cup", held_by, cup, GRASP, margin=0.01)])


TO_A, TO_B, TO_C = MoveTo(A), MoveTo(B), MoveTo(C)
SHUT, OPEN = Gripper("close"), Gripper("open")
TASKS: dict[str, tuple[str | None, list[Any]]] = {
    "never held": (None, [TO_A, TO_B]),
    "taken": (None, [TO_A, Attach("cup", "hand"), TO_B]),
    "taken and set down": (None, [TO_A, Attach("cup", "hand"), TO_B, Detach("cup"), TO_C]),
    "held at the start and kept": ("hand", [TO_A, TO_B]),
    "held and set down": ("hand", [TO_A, Detach("cup"), TO_B]),
    "held, set down at once": ("hand", [Detach("cup"), TO_A]),
    "held, set down and taken again": ("hand", [TO_A, Detach("cup"), TO_B, Attach("cup", "hand"), TO_C]),
    "held, and taken by another link": ("hand", [TO_A, Detach("cup"), Attach("cup", "upper"), TO_B]),
    "held by the finger that closes": ("finger", [TO_A, SHUT, TO_B, OPEN, TO_C]),
    "held by the finger, set down and open": ("finger", [TO_A, SHUT, TO_B, Detach("cup"), OPEN, TO_C]),
    "taken by a finger that has closed": (None, [TO_A, SHUT, Attach("cup", "finger"), TO_B, OPEN, TO_C]),
}


@dataclass
class Page:
    """A page's data, and where its scripts put the things."""

    story: dict[str, Any]
    recording: Recording
    robot: rrtik.Robot

    @classmethod
    def of(cls, subject: Any) -> Page:
        recording, frame = draw(subject)
        return cls(story_of(subject, frame, ""), recording, subject.robot)

    @cached_property
    def transforms(self) -> dict[str, np.ndarray]:
        """Of all nodes, by their paths."""
        commands = map(umsgpack.unpackb, self.recording.commands)
        return {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in commands if c["type"] == "set_transform"}

    @cached_property
    def frames(self) -> np.ndarray:
        """Of all joints in each tick, shape (ticks, joints, 4, 4)."""
        return self.robot.joint_frames(np.array(self.story["waypoints"]))

    def drawn(self, name: str, tick: int) -> list[np.ndarray]:
        """Where things of a name are drawn in a tick, shape (4, 4) each."""
        recorded, found = self.transforms, []
        at = f"/meshcat/obstacles/{node_name(name)}"
        if at in self.recording.paths:
            moving = (self.story["run"] or {"moving": {}})["moving"].get(node_name(name))
            if moving is None:
                found.append(recorded[at])
            elif moving["shown"] is None or moving["shown"][tick]:
                found.append(_matrix(moving["poses"][tick]) @ np.reshape(moving["placement"], (4, 4)))
        for node, frame in zip(self.story["robot"]["nodes"], self.frames[tick], strict=True):
            path = f"/meshcat/robot/{node}/held{node_name(name)}"
            if path in self.recording.paths:
                found.append(frame @ recorded[path])
        return found


def _matrix(row: list[float]) -> np.ndarray:
    return pin.XYZQUATToSE3(np.array(row)).homogeneous


def true_places(world: rrtik.World, q: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Where all things of a world are, by pinocchio alone."""
    robot = world.robot
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q[None])[0])
    for item in world.scene.attached:
        yield item.name, (data.oMf[robot.model.getFrameId(item.link)] * item.pose).homogeneous
    for obstacle in world.scene.obstacles:
        yield obstacle.name, obstacle.pose.homogeneous


def check_things(page: Page, plan: TaskPlan, numbers: list[int]) -> None:
    """Each thing is drawn once, in every tick, where the world of its motion has it."""
    rows = np.array(page.story["waypoints"])
    for tick, number in enumerate(numbers):
        for name, place in true_places(plan.worlds[number], rows[tick]):
            (drawn,) = page.drawn(name, tick)
            np.testing.assert_allclose(drawn, place, atol=2e-5, err_msg=f"'{name}' in tick {tick}")


def numbers_of(story: dict[str, Any]) -> list[int]:
    """The motion of each tick, as the page's list of events has it."""
    return [int(group["reason"].split()[1]) - 1 for group in story["run"]["groups"] for _ in range(group["count"])]


@pytest.fixture(scope="module", params=list(TASKS))
def planned(request: pytest.FixtureRequest, arm: rrtik.Robot) -> tuple[rrtik.World, TaskPlan]:
    held_by, stages = TASKS[request.param]
    world = rrtik.World(arm, scene(held_by))
    plan = Task(stages).plan(world, [0.0, 0.0], seed=1)
    assert plan.found, plan.reason
    return world, plan


def test_things_are_where_the_world_of_each_motion_has_them(planned: tuple[rrtik.World, TaskPlan]) -> None:
    world, plan = planned
    page = Page.of(subject_of_task(world, plan.played()))
    numbers = numbers_of(page.story)
    assert set(numbers) == set(range(len(plan.paths)))
    check_things(page, plan, numbers)


def test_fingers_are_where_the_robot_of_each_motion_has_them(planned: tuple[rrtik.World, TaskPlan]) -> None:
    world, plan = planned
    page = Page.of(subject_of_task(world, plan.played()))
    recorded = page.transforms
    at = np.array(page.story["fingers"]["at"])
    bodies = page.story["fingers"]["bodies"]
    rows = np.array(page.story["waypoints"])
    moved = {world.robot.source.get("locked", {}).get("grip") for world in plan.worlds}
    assert len(bodies) == (len(moved) > 1)
    for tick in np.flatnonzero(at == np.round(at)):
        robot = plan.worlds[int(at[tick])].robot
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(rows[tick][None])[0])
        for body in bodies:
            joint = page.story["robot"]["nodes"].index(body["joint"])
            frame = page.frames[tick][joint]
            own = recorded[f"/meshcat/robot/{body['joint']}/{body['name']}"]
            drawn = frame @ _matrix(body["poses"][int(at[tick])]) @ own
            middle = data.oMf[robot.model.getFrameId("finger")] * rrtik.pose([0.05, 0.0, 0.0])
            np.testing.assert_allclose(drawn, middle.homogeneous, atol=1e-5)


@pytest.mark.parametrize("name", ["held and set down", "taken and set down"])
def test_the_page_of_a_plan_shows_its_first_world_whatever_world_it_is_shown_with(arm: rrtik.Robot, name: str) -> None:
    held_by, stages = TASKS[name]
    plan = Task(stages).plan(rrtik.World(arm, scene(held_by)), [0.0, 0.0], seed=1)
    assert plan.end is not None
    for shown in (arm, plan.end, plan.worlds[-1], rrtik.World(arm)):
        page = Page.of(subject_of_task(shown, plan.played()))
        check_things(page, plan, numbers_of(page.story))


def test_a_tour_shows_what_stands_and_what_is_held(arm: rrtik.Robot) -> None:
    world = rrtik.World(arm, scene("hand"))
    tour = Task([MoveTo(A), MoveTo(B)]).plan(world, [0.0, 0.0], seed=1).require()
    page = Page.of(subject_of(world, tour))
    rows = np.array(page.story["waypoints"])
    for number, q in enumerate(rows):
        for name, place in true_places(world, q):
            (drawn,) = page.drawn(name, number)
            np.testing.assert_allclose(drawn, place, atol=1e-6)


def drifting(time: float) -> rrtik.Scene:
    """The ball of a feed: it is elsewhere than in the problem from the beginning."""
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.05), rrtik.pose([0.0, 1.0 - 0.1 * time, 0.5]))
    return rrtik.Scene([ball], scene("hand").attached)


@pytest.mark.parametrize("source", ["stated", "feed"])
def test_a_run_shows_obstacles_where_they_were_seen(arm: rrtik.Robot, source: str) -> None:
    motion = rrtik.replanning.ConstantVelocity([0.0, 0.1, 0.0])
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.05), rrtik.pose([0.0, -1.0, 0.5]), motion)
    problem = rrtik.Problem(rrtik.World(arm, rrtik.Scene([ball], scene("hand").attached)), [0.0, 0.0], A)
    feed = None if source == "stated" else drifting
    run = rrtik.replan(problem, feed, step=0.05, rate=20.0, seconds=2.0, seed=1)
    page = Page.of(subject_of_run(problem, run))
    for number, tick in enumerate(run.ticks):
        looked = run.ticks[number - 1] if tick.event == "arrive" else tick  # who has arrived looks no more
        seen = problem.world.scene.at(tick.time) if feed is None else feed(looked.time)
        (drawn,) = page.drawn("ball", number)
        np.testing.assert_allclose(drawn, seen.obstacle("ball").pose.homogeneous, atol=2e-5)
        for item in problem.world.scene.attached:
            (drawn,) = page.drawn(item.name, number)
            np.testing.assert_allclose(drawn, (arm.fk(tick.q, item.link) * item.pose).homogeneous, atol=1e-5)


def faulty(time: float) -> rrtik.Scene:
    """The ball of a feed goes away for good, a box comes, another one changes its shape and its name."""
    here, there = rrtik.pose([0.0, -1.5 - time, 0.5]), rrtik.pose([0.0, 1.5, 0.5])
    seen = [rrtik.Obstacle("ball", rrtik.Sphere(0.05), here)] if time < 0.3 else []
    seen += [rrtik.Obstacle("late", rrtik.Box([0.2, 0.2, 0.2]), here)] if time > 0.4 else []
    shape = rrtik.Sphere(0.1) if time < 0.6 else rrtik.Box([0.1, 0.2, 0.3])
    return rrtik.Scene([*seen, rrtik.Obstacle("thing" if time < 0.8 else "renamed", shape, there)])


def test_a_run_shows_what_comes_goes_and_changes_as_its_record_has_it(arm: rrtik.Robot) -> None:
    problem = rrtik.Problem(rrtik.World(arm, faulty(0.0)), [0.0, 0.0], A)
    run = rrtik.replan(
        problem, ((0.05 * k, faulty(0.05 * k)) for k in range(40)), step=0.02, rate=20.0, seconds=1.5, seed=1,
        feed_patience=0.5,
    )  # fmt: skip
    page = Page.of(subject_of_run(problem, run))
    drawn_names = {entry["name"] for entry in page.story["obstacles"]}
    assert drawn_names == {"ball", "late", "thing", "thing (2)", "thing (before)", "renamed"}
    kinds = set()
    for number, tick in enumerate(run.ticks):
        known = next(seen.scene for seen in reversed(run.scenes) if seen.time <= tick.time + 1e-9)
        kinds.add(tuple(o.name for o in known.obstacles))
        places = {name: page.drawn(name, number) for name in drawn_names}
        assert sum(map(len, places.values())) == len(known.obstacles)
        for o in known.obstacles:
            name = "thing (2)" if o.name == "thing" and isinstance(o.shape, rrtik.Box) else o.name
            (drawn,) = places[name]
            np.testing.assert_allclose(drawn, o.pose.homogeneous, atol=2e-5)
    assert len(kinds) > 2, "something came, and something went"


def test_a_run_in_time_shows_obstacles_where_they_are_then(arm: rrtik.Robot) -> None:
    motion = rrtik.replanning.ConstantVelocity([0.0, 0.1, 0.0])
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.05), rrtik.pose([0.0, -1.0, 0.5]), motion)
    problem = rrtik.Problem(rrtik.World(arm, rrtik.Scene([ball], scene("hand").attached)), [0.0, 0.0], A)
    run = rrtik.replanning.plan_in_time(problem, seed=1).motion
    assert run is not None
    page = Page.of(subject_of_run(problem, run))
    for number, tick in enumerate(run.ticks):
        (drawn,) = page.drawn("ball", number)
        expected = problem.world.scene.at(tick.time).obstacle("ball").pose
        np.testing.assert_allclose(drawn, expected.homogeneous, atol=2e-5)
