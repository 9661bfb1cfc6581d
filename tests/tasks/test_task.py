"""Tasks: whole sequences that work, in worlds that hold what the arm holds; what fails is named."""

import time
import warnings
from contextlib import suppress

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Alternatives, Attach, Detach, Gripper, MoveTo, Straight, Task
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError

DOWN = np.diag([1.0, -1.0, -1.0])
CUP = np.array([0.5, 0.2, 0.252])  # [m] its middle, 2 mm above the table
UP = [0.0, 0.0, 0.12]


def hand(x, y, z, yaw=0.0):
    """A pose of the Panda's tip that points down."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ DOWN, np.array([x, y, z]))


def above(pose):
    return pin.SE3(pose.rotation, pose.translation + np.array(UP))


def grasp(yaw, lift=0.02):
    at = hand(CUP[0], CUP[1], CUP[2] + lift, yaw)
    return [MoveTo(above(at)), Straight(to=at), Attach("cup", "panda_hand"), Gripper("close", width=0.05)]


def place(x, y):
    at = hand(x, y, CUP[2] + 0.02)
    return [MoveTo(above(at)), Straight(to=at), Detach("cup"), Gripper("open"), Straight(by=UP)]


@pytest.fixture(scope="module")
def kitchen():
    """A Panda with open fingers before a table with a cup on it and a wall across."""
    robot = rrtik.load_robot("panda")
    robot = rrtik.load_robot("panda", locked=robot.gripper.posture("open"))
    table = rrtik.Obstacle("table", rrtik.Box([0.6, 1.0, 0.04]), [0.5, 0.0, 0.18])
    cup = rrtik.Obstacle("cup", rrtik.Box([0.05, 0.05, 0.1]), CUP)
    wall = rrtik.Obstacle("wall", rrtik.Box([0.3, 0.02, 0.3]), [0.5, 0.0, 0.35])
    return rrtik.World(robot, rrtik.Scene([table, cup, wall]))


def carry():
    """Pick and place with three grasps, the first in the palm's way, and two places, the first too far."""
    stages = [Alternatives([grasp(0.3, lift=-0.01), grasp(0.0), grasp(np.pi / 2)]), Straight(by=UP)]
    return Task([*stages, Alternatives([place(0.5, -1.2), place(0.5, -0.2)])])


@pytest.fixture(scope="module")
def carried(kitchen):
    return carry().plan(kitchen, "ready", seed=1)


@pytest.mark.kernels
def test_pick_and_place_chooses_what_works(carried):
    assert carried.found, carried.reason
    assert carried.chosen[0] in (1, 2)
    assert carried.chosen[1] == 1
    assert [str(stage) for stage in carried.stages] == [
        "MoveTo",
        "Straight",
        "Straight",
        "MoveTo",
        "Straight",
        "Straight",
    ]


@pytest.mark.kernels
def test_each_motion_begins_where_the_one_before_ends_and_is_free_in_its_own_world(carried, kitchen):
    assert np.array_equal(carried.paths[0].start, kitchen.robot.posture("ready"))
    for before, after in zip(carried.paths[:-1], carried.paths[1:], strict=True):
        assert np.abs(before.end - after.start).max() <= 1e-12
    for path, world in zip(carried.paths, carried.worlds, strict=True):
        assert path.violations(world) == ()
        assert world.valid_batch(path.resample(0.01).waypoints).all()


@pytest.mark.kernels
def test_what_is_held_moves_with_the_hand_and_stays_where_it_is_let_go(carried):
    held = [[item.name for item in world.scene.attached] for world in carried.worlds]
    assert held == [[], [], ["cup"], ["cup"], ["cup"], []]
    lift, last = carried.worlds[2], carried.worlds[5]
    item = lift.scene.attached[0]
    at_first = lift.robot.fk(carried.paths[2].start, item.link) * item.pose
    assert np.allclose(at_first.translation, CUP, atol=2e-4)
    put = last.scene.obstacle("cup").pose
    assert np.allclose(put.translation, [0.5, -0.2, CUP[2]], atol=2e-3)
    fingers = [world.robot.source["locked"]["panda_finger_joint1"] for world in carried.worlds]
    assert fingers == [0.04, 0.04, 0.025, 0.025, 0.025, 0.04]


@pytest.mark.kernels
def test_the_same_seed_gives_the_same_plan(kitchen):
    task = Task([*grasp(0.0), Straight(by=UP)])
    first, second = (task.plan(kitchen, "ready", seed=4) for _ in range(2))
    assert len(first.paths) == len(second.paths) == 3
    for one, other in zip(first.paths, second.paths, strict=True):
        assert np.array_equal(one.waypoints, other.waypoints)


@pytest.mark.kernels
def test_a_goal_with_several_configurations_is_chosen_so_that_what_follows_works(titan):
    """Of the configurations at a pose most cannot go on along the line; backtracking finds one that can."""
    world, rng, tried = rrtik.World(titan), np.random.default_rng(7), 0
    while tried < 3:
        begin = titan.fk(rng.uniform(*titan.finite_range()))
        branches = rrtik.solve_ik(titan, rrtik.PoseGoal(begin), all=True, world=world, near=np.zeros(6)).solutions
        shift = rng.normal(0.0, 0.2, 3)
        goal = pin.SE3(begin.rotation, begin.translation + shift)
        ends = [rrtik.tip.straight(world, q, goal).fraction for q in branches]
        if len(ends) < 2 or ends[0] == 1.0 or max(ends) < 1.0:  # the nearest one fails
            continue
        plan = Task([MoveTo(begin), Straight(by=shift)]).plan(world, np.zeros(6), seed=1)
        assert plan.found, plan.reason
        tried += 1


@pytest.mark.kernels
def test_a_failure_names_the_stage_and_the_reason_of_each_alternative(kitchen):
    task = Task([Alternatives([grasp(0.0, lift=-0.02), [MoveTo(hand(3.0, 0.0, 0.5))]]), Straight(by=UP)])
    plan = task.plan(kitchen, "ready", seconds=5.0, seed=1)
    assert not plan.found
    assert (plan.paths, plan.worlds, plan.stages) == ((), (), ())
    assert "stage 1.1.2 (Straight)" in plan.reason
    assert "'cup'" in plan.reason
    assert "stage 1.2.1 (MoveTo)" in plan.reason
    assert "goal out of reach: the closest configuration is 2" in plan.reason
    assert "\n" not in plan.reason


@pytest.mark.kernels
def test_time_is_kept_and_said(kitchen):
    plan = Task(grasp(0.0)).plan(kitchen, "ready", seconds=1e-9)
    assert not plan.found
    assert plan.reason.startswith("out of time")


@pytest.mark.parametrize(
    ("stages", "words"),
    [
        (
            [Attach("cup", "panda_hand"), Attach("cup", "panda_hand")],
            r"stage 2 \(Attach 'cup'\): 'cup' is held already",
        ),
        ([Detach("cup")], r"stage 1 \(Detach 'cup'\): 'cup' is not held here"),
        ([Alternatives([[MoveTo("ready")], [Detach("wall")]])], r"stage 1.2.1 \(Detach 'wall'\)"),
        ([Alternatives([[Attach("cup", "panda_hand")], [MoveTo("ready")]]), Detach("cup")], "stage 2"),
        ([Attach("mug", "panda_hand")], "no obstacle 'mug'"),
        ([Attach("cup", "hand")], "no link of robot 'panda' 'hand'"),
        ([Attach("cup", "panda_hand", allow=("desk",))], "no link or obstacle 'desk'"),
        ([Gripper("close", width=0.2)], "opens from 0 to 0.08 m"),
        ([MoveTo("nowhere")], r"stage 1 \(MoveTo\): no posture"),
        ([MoveTo([0.0, 1.0])], r"stage 1 \(MoveTo\): goal: robot 'panda' has 7 joints"),
    ],
)
def test_what_can_never_be_done_is_refused_before_the_search(kitchen, stages, words):
    with pytest.raises(InputError, match=words) as caught:
        Task(stages).plan(kitchen, "ready")
    assert "\n" not in str(caught.value)


def test_a_robot_without_gripper_joints_and_a_start_in_collision(titan):
    world = rrtik.World(titan)
    with pytest.raises(InputError, match="has no gripper joints"):
        Task([Gripper("open")]).plan(world, "ready")
    block = rrtik.Scene([rrtik.Obstacle("block", rrtik.Sphere(0.2), titan.fk(titan.posture("ready")))])
    with pytest.raises(ProblemError, match="block"):
        Task([MoveTo("zero")]).plan(world.with_scene(block), "ready")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Straight(), "give its end"),
        (lambda: Straight(by=UP, to=UP), "only one"),
        (lambda: Straight(by=[0.0, 0.0, 0.0]), "leads nowhere"),
        (lambda: Straight(by=UP, frame="hand"), "frame of Straight"),
        (lambda: Gripper("shut"), "state of a gripper"),
        (lambda: Gripper("close", width=-0.1), "width"),
        (lambda: Gripper("close", opening=1.1), "expected 0"),
        (lambda: Gripper("close", opening="half"), "opening of Gripper"),
        (lambda: Gripper("close", width=0.1, opening=0.5), "not both"),
        (lambda: Alternatives([]), "none of them empty"),
        (lambda: Alternatives([[]]), "none of them empty"),
        (lambda: Task([]), "at least one stage"),
        (lambda: Task([MoveTo("ready"), "open"]), "each stage of a task"),
        (lambda: Task(MoveTo("ready")), "stages of a task must be a list, got MoveTo"),
        (lambda: Attach("cup", 3), "link of Attach"),
        (lambda: Attach("cup", "panda_hand", padding=-0.01), "padding of Attach must not be negative"),
        (lambda: MoveTo(np.diag([1.0, 1.0, -1.0, 1.0])), "mirrors"),
    ],
)
def test_stages_that_are_none_are_refused_in_a_line(make, words):
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_shift_in_the_tips_axes_and_in_the_worlds():
    tip = pin.SE3(DOWN, np.array([0.1, 0.2, 0.3]))
    assert np.allclose(Straight(by=UP, frame="tip").goal(tip).translation, [0.1, 0.2, 0.18])
    assert np.allclose(Straight(by=UP).goal(tip).translation, [0.1, 0.2, 0.42])
    to = Straight(to=[0.5, 0.0, 0.0]).goal(tip)
    assert np.allclose(to.translation, [0.5, 0.0, 0.0])
    assert np.allclose(to.rotation, DOWN)


def test_fingers_close_on_a_width():
    gripper = rrtik.load_robot("panda").gripper
    assert gripper.posture("open") == {"panda_finger_joint1": 0.04}
    assert gripper.posture("closed") == gripper.posture("close") == {"panda_finger_joint1": 0.0}
    robot = rrtik.load_robot("panda", locked=gripper.close_on(0.05))
    q = robot.posture("ready")
    left, right = (robot.fk(q, f"panda_{side}finger").translation for side in ("left", "right"))
    assert np.linalg.norm(left - right) == pytest.approx(0.05)
    with pytest.raises(UnknownNameError, match="state of a gripper"):
        gripper.posture("ajar")


@pytest.mark.kernels
def test_jaws_that_turn_close_by_a_share_and_a_pose_leaves_a_turn_free(tmp_path):
    """An SO-101 has five joints and one jaw that turns, so it has no width."""
    robot = rrtik.load_robot("so101", locked=rrtik.load_robot("so101").gripper.at(0.6))
    pose = rrtik.pose([0.22, 0.05, 0.08], rpy=[np.pi, 0.0, 0.7])
    stages = [MoveTo(rrtik.GoalSet([pose], free_rotation_axis="z")), Gripper("close", opening=0.2)]
    Task(stages, rrtik.World(robot), np.zeros(5)).save(tmp_path / "task.yaml")
    task = Task.load(tmp_path / "task.yaml")
    plan = task.plan(seed=1)
    shares = robot.gripper.share([event.positions for event in plan.time_parameterize().trajectory.gripper])
    assert shares == pytest.approx([0.6, 0.2])
    tip = plan.worlds[0].robot.fk(plan.path.end)
    assert tip.translation == pytest.approx(pose.translation, abs=1e-3)
    assert tip.rotation[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=0.02)


@pytest.fixture
def hurried(monkeypatch):
    """All clocks run ten thousand times as fast: what hangs on them and not on a time limit that is longer changes."""
    for name in ("monotonic", "perf_counter"):
        real = getattr(time, name)
        monkeypatch.setattr(time, name, lambda real=real: 1e4 * real())


@pytest.mark.kernels
def test_a_busy_machine_does_not_change_the_plan_of_a_seed(carried, kitchen, request):
    request.getfixturevalue("hurried")
    again = carry().plan(kitchen, "ready", seed=1, seconds=1e7)
    assert again.chosen == carried.chosen
    for one, other in zip(carried.paths, again.paths, strict=True):
        assert np.array_equal(one.waypoints, other.waypoints)


@pytest.mark.kernels
def test_a_line_to_where_the_tip_is_already_is_done_at_once(kitchen):
    here = kitchen.robot.fk(kitchen.robot.posture("ready"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plan = Task([Straight(to=here), Straight(by=UP)]).plan(kitchen, "ready", seed=1)
    assert plan.found, plan.reason
    assert plan.paths[0].length == 0.0
    assert plan.paths[0].proven
    assert plan.paths[1].length > 0.0


@pytest.mark.kernels
def test_the_world_after_the_last_stage_is_part_of_the_plan(kitchen):
    plan = Task(grasp(0.0)).plan(kitchen, "ready", seed=1)
    assert [item.name for item in plan.worlds[-1].scene.attached] == []
    assert [item.name for item in plan.end.scene.attached] == ["cup"]
    assert plan.end.robot.source["locked"]["panda_finger_joint1"] == 0.025
    assert plan.end.valid(plan.paths[-1].end)
    still = Task([Gripper("close")]).plan(kitchen, "ready", seed=1)
    assert still.found
    assert still.end.robot.source["locked"]["panda_finger_joint1"] == 0.0


@pytest.mark.kernels
def test_a_gripper_that_closes_into_something_at_the_end_is_no_plan(kitchen):
    reach = grasp(0.0)[:2]
    plan = Task([*reach, Gripper("close", width=0.03)]).plan(kitchen, "ready", seed=1)
    assert not plan.found
    assert "stage 3 (Gripper 'close' to 30 mm)" in plan.reason
    assert "finger" in plan.reason
    assert "attach the object" in plan.reason


@pytest.mark.kernels
def test_an_object_attached_from_far_away_is_noted(kitchen, carried):
    plan = Task([Attach("cup", "panda_hand"), Straight(by=UP)]).plan(kitchen, "ready", seed=1)
    assert plan.found, plan.reason
    (note,) = plan.notes
    hand_at = kitchen.robot.fk(kitchen.robot.posture("ready"), "panda_hand").translation
    said = float(note.split(" is ")[1].split(" mm")[0]) / 1e3
    assert note.startswith("stage 1 (Attach 'cup'): 'cup' is ")
    assert np.linalg.norm(hand_at - CUP) - 0.3 < said < np.linalg.norm(hand_at - CUP)
    assert carried.notes == ()


@pytest.mark.parametrize(
    "value", [None, 3, 1.5, "x", [], {}, [None], [[1, 2], [3]], np.nan, np.eye(3), np.ma.masked, 1j]
)
def test_every_argument_of_a_stage_is_taken_or_refused_in_a_line(value):
    made = [
        lambda: MoveTo(value),
        lambda: Straight(by=value),
        lambda: Straight(to=value),
        lambda: Straight(by=UP, frame=value),
        lambda: Attach(value, "panda_hand"),
        lambda: Attach("cup", value),
        lambda: Attach("cup", "panda_hand", value),
        lambda: Detach(value),
        lambda: Gripper(value),
        lambda: Gripper("open", value),
        lambda: Alternatives(value),
        lambda: Alternatives([value]),
        lambda: Task(value),
    ]
    for make in made:
        with suppress(InputError):  # whose text is a line, always; nothing else may be raised
            make()


@pytest.mark.kernels
def test_what_is_held_keeps_its_padding_and_what_is_let_go_has_none():
    robot = rrtik.load_robot("ur5")
    start = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
    tip = robot.fk(start).translation
    part = rrtik.Obstacle("part", rrtik.Sphere(0.02), tip - np.array([0.0, 0.0, 0.1]))
    shelf = rrtik.Obstacle("shelf", rrtik.Box([0.2, 0.2, 0.02]), tip - np.array([0.0, 0.0, 0.15]))  # 20 mm lower
    world = rrtik.World(
        robot, rrtik.Scene([part, shelf], allowed_collisions=[("part", "ee_link"), ("part", "wrist_3_link")])
    )

    def taken(padding):
        return Task(
            [Attach("part", "ee_link", ["wrist_3_link"], padding=padding), Straight(by=[0.0, 0.1, 0.0]), Detach("part")]
        )

    plan = taken(0.015).plan(world, start, seed=1)
    assert plan.found, plan.reason
    assert plan.worlds[0].scene.attached[0].padding == 0.015
    again = Task([Attach("part", "ee_link", padding=0.0), Straight(by=[0.0, -0.1, 0.0])])
    assert again.plan(plan.end, plan.paths[-1].end, seed=1).found
    refused = taken(0.025).plan(world, start, seed=1)
    assert not refused.found
    assert "shelf" in refused.reason


def test_of_several_lines_the_one_is_taken_whose_weighted_way_is_shorter():
    start, taken = [0.0, -1.6, 1.8, -0.2, 1.6, 0.0], []
    lines = Alternatives([[Straight(by=[0.0, 0.05, 0.0])], [Straight(by=[0.0, 0.0, 0.12])]])  # the base turns, or not
    for weights in (None, {"shoulder_pan_joint": 20.0}):
        world = rrtik.World(rrtik.load_robot("ur5", joint_weights=weights))
        taken.append(Task([lines]).plan(world, start, seed=1).chosen)
    assert taken == [(0,), (1,)]
