"""A contact has a life: it begins where a thing is taken or set down, and ends where the two have parted."""

import dataclasses
import itertools
import json
import pickle
import re
import time

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Alternatives, Attach, Detach, Gripper, MoveTo, Straight, Task
from rrtik_ompl.cli.app import run
from rrtik_ompl.tasks.contact_life import MotionContact

pytestmark = pytest.mark.kernels

UP = [0.0, 0.0, 0.12]
DOWN = [0.0, 0.0, -0.12]
TOP = 0.2  # [m] of the table
CUP = rrtik.Box([0.05, 0.05, 0.1])
PLACE = np.array([0.5, 0.25, TOP + 0.05])  # a cup's middle that stands on the table
TABLE = rrtik.Obstacle("table", rrtik.Box([0.7, 1.2, 0.04]), [0.55, 0.0, TOP - 0.02])
ROD = rrtik.Box([0.04, 0.04, 0.2])
STRETCHED = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])  # of a UR5


@pytest.fixture(scope="module")
def panda():
    return rrtik.load_robot("panda", locked={"panda_finger_joint1": 0.04})


@pytest.fixture(scope="module")
def ur5():
    return rrtik.load_robot("ur5")


def above(x, y, height=0.14, yaw=0.0):
    """The Panda's tip over a place on the table, looking down."""
    return rrtik.PoseGoal([x, y, TOP + 0.05 + height, np.pi, 0.0, yaw])


def scene(*more, cup=CUP, inside=0.0, table=TABLE):
    return rrtik.Scene([table, rrtik.Obstacle("cup", cup, PLACE - np.array([0.0, 0.0, inside])), *more])


def taken(**options):
    reach = [MoveTo(above(*PLACE[:2])), Straight(by=DOWN)]
    return [*reach, Attach("cup", "panda_hand", **options), Gripper("close", width=0.05)]


def put(deeper=0.0):
    lower = Straight(by=[0.0, 0.0, -0.12 - deeper])
    return [MoveTo(above(0.5, -0.25)), lower, Detach("cup"), Gripper("open"), Straight(by=UP)]


def planned(robot, around, stages, start="ready", seconds=10.0):
    return Task(stages).plan(rrtik.World(robot, around), start, seconds=seconds, seed=1)


def refused(robot, around, stages, words, start="ready"):
    """What is said of a task that cannot be done, with more time for a machine that is busy until words are in it."""
    for seconds in (1.0, 5.0, 25.0):
        plan = planned(robot, around, stages, start, seconds)
        assert not plan.found
        if words in plan.reason:
            break
    return plan.reason


class Judge:
    """Depths of a held thing in others along motions, by pinocchio and coal from the shapes alone."""

    def __init__(self, robot, link, sides, others):
        self.model, self.data, self.link = robot.model, robot.model.createData(), link
        self.solid = coal.Box(*sides)
        self.others = [(coal.Box(*shape.size), pose) for shape, pose in others]

    def gaps(self, robot, rows, grasp):
        """Least signed distance at each of some configurations [m]."""
        found = []
        frame = self.model.getFrameId(self.link)
        for full in robot.pinocchio_configuration(rows):
            pin.framesForwardKinematics(self.model, self.data, full)
            held = self.data.oMf[frame] * grasp
            found.append(min(self._gap(held, solid, pose) for solid, pose in self.others))
        return np.array(found)

    def _gap(self, held, solid, pose):
        places = [coal.Transform3s(each.rotation, each.translation) for each in (held, pose)]
        ends = (self.solid, places[0], solid, places[1])
        return coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult())


def judged(plan, others=(TABLE,), sides=(0.05, 0.05, 0.1)):
    """The gaps of each motion that carries something."""
    found = []
    for path, world in zip(plan.paths, plan.worlds, strict=True):
        for item in world.scene.attached:
            judge = Judge(world.robot, item.link, sides, [(each.shape, each.pose) for each in others])
            found.append(judge.gaps(world.robot, path.resample(0.002).waypoints, item.pose))
    return found


@pytest.mark.parametrize("inside", [0.0, 0.0005, 0.003])
def test_what_stands_on_a_table_is_taken_and_set_down_without_a_word(panda, inside):
    plan = planned(panda, scene(inside=inside), [*taken(), Straight(by=UP), *put(-inside)])
    assert plan.found, plan.reason
    assert plan.proven
    assert plan.violations() == ()
    lift, carry, lower = judged(plan)
    assert lift.min() >= -inside - 1.001e-3
    parted = np.flatnonzero(lift > 1e-4)[0]
    assert lift[parted:].min() >= 0.0
    assert carry.min() >= 0.0
    assert lower.min() >= -1.001e-3
    assert "'cup' and 'table' may overlap by" in plan.notes[0]
    (contact,) = plan.contacts[2]
    assert contact.touching.distance == pytest.approx(-inside - 1e-3, abs=1e-5)
    assert 0 < contact.until < len(plan.paths[2].waypoints)
    assert [world.scene.allowed_collisions for world in plan.worlds] == [()] * len(plan.worlds)
    assert plan.end.scene.contacts == ()


@pytest.mark.parametrize(("deeper", "found"), [(0.0, True), (0.0009, True), (0.0015, False), (0.03, False)])
def test_what_would_be_left_deep_inside_another_thing_is_refused_with_the_depth(panda, deeper, found):
    stages = [*taken(allow=["table"]), Straight(by=UP), *put(deeper)]
    plan = planned(panda, scene(), stages, seconds=30.0 if found else 4.0)
    assert plan.found == found, plan.reason
    if not found:
        assert f"'cup' would be left {1e3 * deeper:.2g}" in plan.reason
        assert "mm inside 'table'; 1 mm at most" in plan.reason


@pytest.mark.parametrize("deeper", [0.02, 0.03])
def test_what_no_choice_can_set_down_is_refused_at_once(panda, deeper):
    begun = time.process_time()
    plan = planned(panda, scene(), [*taken(), Straight(by=UP), *put(deeper)], seconds=20.0)
    assert time.process_time() - begun < 5.0
    assert re.match(rf"stage 8 \(Detach 'cup'\).* {1e3 * deeper:.3g} mm .*'table'.* 1 mm", plan.reason)


def test_the_look_ahead_lets_go_of_what_it_does_not_know(panda):
    """A thing that is held from the beginning, is let go and taken again: where it stands then is not foreseen."""
    q = planned(panda, scene(), taken()[:2]).paths[-1].end
    grasp = panda.fk(q, "panda_hand").actInv(pin.SE3(np.eye(3), PLACE))
    around = rrtik.Scene([TABLE], [rrtik.AttachedObject("cup", "panda_hand", CUP, grasp)])
    stages = [Detach("cup"), Attach("cup", "panda_hand"), Straight(by=UP), Straight(by=[0.0, 0.0, -0.12])]
    plan = planned(panda, around, [*stages, Detach("cup"), Gripper("open"), Straight(by=UP)], start=q)
    assert plan.found, plan.reason
    assert plan.violations() == ()


def test_a_thing_that_stands_deep_inside_another_needs_a_word_and_may_not_be_let_go_there(panda):
    around = scene(inside=0.01)
    words = "'table' and 'cup' overlap by 10 mm"
    assert words in refused(panda, around, [*taken(), Straight(by=UP)], words)
    assert planned(panda, around, [*taken(allow=["table"]), Straight(by=UP)]).found
    words = "'cup' would be left 10 mm inside 'table'"
    assert words in refused(panda, around, [*taken(allow=["table"]), Detach("cup")], words)


def rod_at(ur5, wall_away):
    """A UR5 that holds nothing at a rod beside a wall, and poses of the tip there, before and behind the wall."""
    tip = ur5.fk(STRETCHED).translation
    rod = rrtik.Obstacle("rod", ROD, tip + np.array([0.0, 0.0, -0.12]))
    wall = rrtik.Obstacle("wall", rrtik.Box([0.3, 0.02, 0.1]), tip + np.array([0.0, 0.03 + wall_away, -0.2]))
    pairs = [("rod", "ee_link"), ("rod", "wrist_3_link")]
    return rrtik.World(ur5, rrtik.Scene([rod, wall], allowed_collisions=pairs))


def test_what_a_grasp_allowed_ends_with_the_grasp(ur5):
    world = rod_at(ur5, 0.0)
    through = Straight(by=[0.0, 0.1, 0.0])
    first = [Attach("rod", "ee_link", allow=["wall"]), Detach("rod")]
    for grasp in ([], first):
        plan = Task([*grasp, Attach("rod", "ee_link"), through]).plan(world, STRETCHED, seconds=30.0, seed=1)
        assert not plan.found
        assert "'rod'" in plan.reason
        assert "'wall'" in plan.reason
    away = Task([*first, Attach("rod", "ee_link"), Straight(by=[0.0, -0.05, 0.0])]).plan(world, STRETCHED, seed=1)
    assert away.found, away.reason
    assert away.end.scene.allowed_collisions == world.scene.allowed_collisions


def test_what_a_grasp_allows_may_be_touched_as_long_as_it_holds_and_no_deeper(ur5):
    world = rod_at(ur5, 0.02)
    for deep, found in ((0.0205, True), (0.03, False)):
        stages = [Attach("rod", "ee_link", allow=["wall"]), Straight(by=[0.0, deep, 0.0]), Straight(by=UP)]
        plan = Task(stages).plan(world, STRETCHED, seconds=20.0, seed=1)
        assert plan.found == found, plan.reason
    plain = Task([Attach("rod", "ee_link"), Straight(by=[0.0, 0.0205, 0.0])]).plan(world, STRETCHED, seconds=20.0)
    assert not plain.found


def test_what_has_parted_counts_again(panda):
    down_again = [Straight(by=UP), Straight(by=[0.0, 0.0, -0.1205]), Straight(by=UP)]
    reason = refused(panda, scene(), [*taken(), *down_again], "'cup'")
    assert "'cup'" in reason
    assert "'table'" in reason


def test_a_contact_lasts_while_a_thing_slides(panda):
    plan = planned(panda, scene(), [*taken(), Straight(by=[0.0, -0.1, 0.0]), Straight(by=UP)])
    assert plan.found, plan.reason
    assert [[each.until is None for each in row] for row in plan.contacts[2:]] == [[True], [False]]
    assert min(gaps.min() for gaps in judged(plan)) >= -1.001e-3


def test_things_on_each_other_and_between_walls_part_one_by_one(panda):
    top = rrtik.Obstacle("top", rrtik.Box([0.05, 0.05, 0.06]), PLACE + np.array([0.0, 0.0, 0.08]))
    wall = rrtik.Obstacle("wall", rrtik.Box([0.02, 0.1, 0.05]), PLACE + np.array([0.035, 0.0, 0.055]))
    reach = [MoveTo(above(*PLACE[:2], height=0.21)), Straight(by=DOWN), Attach("top", "panda_hand")]
    upper = planned(panda, scene(top, wall), [*reach, Gripper("close", width=0.05), Straight(by=UP)])
    assert upper.found, upper.reason
    pairs = {frozenset(each.touching.names) for each in upper.contacts[2]}
    assert pairs == {frozenset(("top", "cup")), frozenset(("top", "wall"))}
    words = "'top' and 'cup'"
    assert words in refused(panda, scene(top), [Attach("cup", "panda_hand"), Straight(by=[0.0, 0.0, 0.02])], words)


def test_a_cup_in_the_margin_of_its_table_is_taken_and_set_down(panda):
    table = dataclasses.replace(TABLE, margin=0.02)
    plan = planned(panda, scene(table=table), [*taken(), Straight(by=UP), *put()])
    assert plan.found, plan.reason
    assert plan.violations() == ()
    lift, carry, _ = judged(plan)
    assert lift[-1] > 0.02
    assert carry.min() >= 0.02


def test_a_motion_by_any_way_may_begin_and_end_in_contact(panda):
    stages = [*taken(), MoveTo(above(0.5, -0.25, height=0.0199)), Detach("cup"), Gripper("open"), Straight(by=UP)]
    plan = planned(panda, scene(), stages)
    assert plan.found, plan.reason
    assert plan.violations() == ()
    assert min(gaps.min() for gaps in judged(plan)) >= -1.001e-3


def test_two_things_that_the_arm_holds_part_and_stay_apart(ur5):
    """A cup at the tip stands on a tray on the forearm: both move."""
    tip = ur5.fk(STRETCHED).translation
    cup = rrtik.Obstacle("cup", rrtik.Box([0.06, 0.06, 0.1]), tip + np.array([0.0, 0.0, -0.12]))
    tray = pin.SE3(np.eye(3), tip + np.array([0.0, 0.0, -0.18]))
    grasp = ur5.fk(STRETCHED, "forearm_link").actInv(tray)
    held = rrtik.AttachedObject(
        "tray", "forearm_link", rrtik.Box([0.15, 0.15, 0.02]), grasp, ("wrist_1_link", "wrist_2_link")
    )
    world = rrtik.World(ur5, rrtik.Scene([cup], [held]))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        goals = STRETCHED + np.pad(rng.uniform(-0.5, 0.5, (6, 3)), ((0, 0), (3, 0)))
        goal = next(q for q in goals if not touches(ur5, q, cup, held))
        plan = Task([Attach("cup", "tool0"), MoveTo(goal)]).plan(world, STRETCHED, seconds=3.0, seed=1)
        assert plan.found, plan.reason
        assert plan.violations() == ()
        assert plan.contacts[0][0].until is not None


def touches(robot, q, cup, tray):
    """Whether two boxes that links hold overlap at q, by coal."""
    grasp = robot.fk(STRETCHED, "tool0").actInv(cup.pose)
    poses = robot.fk(q, "tool0") * grasp, robot.fk(q, "forearm_link") * tray.pose
    solids = coal.Box(*cup.shape.size), coal.Box(*tray.shape.size)
    places = [coal.Transform3s(each.rotation, each.translation) for each in poses]
    found = coal.distance(solids[0], places[0], solids[1], places[1], coal.DistanceRequest(), coal.DistanceResult())
    return found < 0.002


def test_an_alternative_that_does_not_set_the_thing_down_may_not_touch(panda):
    lower = [MoveTo(above(0.5, -0.25)), Straight(by=[0.0, 0.0, -0.1205])]
    onwards = Alternatives([[Straight(by=UP), Detach("cup")], [Gripper("close", width=0.05)]])
    plan = planned(panda, scene(), [*taken(), Straight(by=UP), *lower, onwards], seconds=2.0)
    assert not plan.found


def test_a_suction_cup_may_touch_what_it_takes_next_and_has_set_down(ur5):
    tip = ur5.fk(STRETCHED).translation
    part = rrtik.Obstacle("part", rrtik.Box([0.06, 0.06, 0.1]), tip + np.array([0.0, 0.0, -0.15]))
    table = rrtik.Obstacle("table", rrtik.Box([0.2, 0.4, 0.05]), tip + np.array([0.03, 0.0, -0.225]))
    turned = rrtik.PoseGoal([*(tip + np.array([0.0, 0.0, -0.05])), np.pi, 0.0, 0.0])
    stages = [MoveTo(turned), Straight(by=[0.0, 0.0, -0.05]), Attach("part", "tool0"), Straight(by=[0.0, 0.0, 0.05])]
    world = rrtik.World(ur5, rrtik.Scene([part, table]))
    up = [*stages, Straight(by=[0.0, 0.0, -0.05]), Detach("part"), Straight(by=[0.0, 0.0, 0.05])]
    plan = Task(up).plan(world, STRETCHED, seed=1)
    assert plan.found, plan.reason
    assert plan.proven
    assert plan.violations() == ()


def test_a_thing_held_from_the_beginning_may_touch_what_it_touches(tmp_path, panda, capsys):
    q = planned(panda, scene(), taken()[:2]).paths[-1].end
    grasp = panda.fk(q, "panda_hand").actInv(pin.SE3(np.eye(3), PLACE))
    held = rrtik.AttachedObject("cup", "panda_hand", CUP, grasp)
    around = rrtik.Scene([TABLE], [held])
    plan = planned(panda, around, [Straight(by=UP)], start=q)
    assert plan.found, plan.reason
    assert plan.contacts[0][0].touching.names == ("cup", "table")
    rrtik.Problem(rrtik.World(panda, rrtik.Scene([], [held])), q, "ready").save(tmp_path / "p.yaml")
    text = (tmp_path / "p.yaml").read_text().split("goal:")[0]
    where = {"xyz": [0.55, 0.0, TOP - 0.02]}
    table = f"scene:\n  obstacles:\n  - {{name: table, box: [0.7, 1.2, 0.04], pose: {json.dumps(where)}}}\n"
    (tmp_path / "t.yaml").write_text(text.replace("scene:\n", table) + "task:\n- straight: {by: [0, 0, 0.12]}\n")
    assert run(["task", str(tmp_path / "t.yaml")]) == 0
    assert "stands on a contact: 'cup' and 'table'" in capsys.readouterr().out


def test_contacts_are_listed_in_the_order_of_the_world(tmp_path, panda, capsys):
    names = [f"stone {k}" for k in range(8)]
    far_away = [rrtik.Obstacle(name, rrtik.Sphere(0.05), [3.0, 0.3 * k, 0.0]) for k, name in enumerate(names)]
    contacts = [rrtik.Touching("panda_hand", name, 0.0) for name in reversed(names)]
    plan = planned(panda, rrtik.Scene(far_away, contacts=contacts), [MoveTo(above(*PLACE[:2]))])
    plan.save(tmp_path / "plan.json")
    assert run(["check", str(tmp_path / "plan.json")]) == 0
    assert re.findall(r"stands on a contact: 'panda_hand' and '(.*)'", capsys.readouterr().out) == names[::-1]


def test_the_check_of_a_saved_plan_names_contacts_and_finds_those_that_are_not_said(tmp_path, panda, capsys):
    plan = planned(panda, scene(), [*taken(), Straight(by=UP)])
    file = tmp_path / "plan.json"
    plan.save(file)
    assert run(["check", str(file)]) == 0
    assert "motion 3 stands on a contact: 'cup' and 'table' may overlap by 1 mm, up to" in capsys.readouterr().out
    document = json.loads(file.read_text())
    document["motions"][2]["scene"].pop("contacts")
    document["motions"][2].pop("contacts")
    file.write_text(json.dumps(document))
    assert run(["check", str(file)]) == 1
    assert "not valid: " in capsys.readouterr().out
    assert run(["check", str(file), str(file)]) == 2


@pytest.fixture(scope="module")
def put_down(panda):
    """The document of a plan that takes a cup off a table and sets it down elsewhere."""
    plan = planned(panda, scene(), [*taken(), Straight(by=UP), *put()])
    assert plan.found, plan.reason
    return plan


def as_deep_as_it_likes(document):
    motion = document["motions"][2]
    motion["contacts"][0]["distance"] = motion["scene"]["contacts"][0]["distance"] = -0.02
    motion["contacts"][0].pop("until")


def deeper_than_it_was(document):
    motion = document["motions"][2]
    motion["contacts"][0]["distance"] = motion["scene"]["contacts"][0]["distance"] = -0.004


def deeper_when_it_touches_again(document):
    document["motions"][2]["contacts"][0]["then"] = -1.0


def moved_in_the_hand(document):
    document["motions"][3]["scene"]["attached"][0]["pose"]["xyz"][2] -= 0.02


def left_elsewhere(document):
    cup = next(each for each in document["motions"][5]["scene"]["obstacles"] if each["name"] == "cup")
    cup["pose"]["xyz"][0] += 0.002


def left_elsewhere_at_the_end(document):
    cup = next(each for each in document["end"]["scene"]["obstacles"] if each["name"] == "cup")
    cup["pose"]["xyz"][0] += 0.002


def the_cup(document, number):
    scene = document["motions"][number]["scene"]
    (cup,) = [each for key in ("obstacles", "attached") for each in scene.get(key, ()) if each["name"] == "cup"]
    return cup


def thinner(document):
    cup = the_cup(document, 4)
    cup["box"][0] *= 0.5


def with_less_room(document):
    the_cup(document, 1)["margin"] = 0.01


def padded_meanwhile(document):
    the_cup(document, 3)["padding"] = 0.001


def may_touch_more(document):
    the_cup(document, 3)["allow"] = ["table"]


def allowed_meanwhile(document):
    document["motions"][3]["scene"]["allowed_collisions"] = [["cup", "table"]]


def another_robot_meanwhile(document):
    document["motions"][3]["robot"]["padding"] = {"panda_link5": 0.01}


def of_a_name_that_is_not_there(document):
    document["motions"][2]["contacts"].append({"pair": ["cup", "saucer"], "distance": -0.001, "until": 1})


def of_a_scene_that_has_it_not(document):
    document["motions"][3]["contacts"] = [{"pair": ["cup", "table"], "distance": -0.001}]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (as_deep_as_it_likes, "motion 3: contact of 'cup' and 'table': they may overlap by 1 mm at most, not by 20"),
        (deeper_than_it_was, "motion 3: contact of 'cup' and 'table': they may overlap by 1 mm at most, not by 4"),
        (deeper_when_it_touches_again, "motion 3: contact of 'cup' and 'table': they may overlap by 1 mm at most"),
        (moved_in_the_hand, "motion 4: 'cup' is not where the motion before has left it: 20 mm"),
        (left_elsewhere, "motion 6: 'cup' is not where the motion before has left it: 2 mm"),
        (left_elsewhere_at_the_end, "after motion 6: 'cup' is not where the motion before has left it: 2 mm"),
        (thinner, "motion 5: 'cup' has not the shape that it had before"),
        (with_less_room, "motion 2: 'cup' has not the margin that it had before"),
        (padded_meanwhile, "motion 4: 'cup' has not the padding that it had before"),
        (may_touch_more, "motion 4: 'cup' has not the list of what it may touch that it had before"),
        (allowed_meanwhile, "motion 4: the allowed collisions are not those of the motion before"),
        (another_robot_meanwhile, "motion 4: the robot is not described as in the motion before"),
        (of_a_name_that_is_not_there, "motion 3: contact of 'cup' and 'saucer': there is no link or object 'saucer'"),
        (of_a_scene_that_has_it_not, "motion 4: contact of 'cup' and 'table': the motion's scene has no such contact"),
    ],
)
def test_the_check_of_a_saved_plan_does_not_take_its_word(tmp_path, put_down, capsys, change, said):
    file = tmp_path / "plan.json"
    put_down.save(file)
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))
    assert run(["check", str(file)]) == 1
    printed = capsys.readouterr().out
    assert f"not valid: {said}" in printed
    number = int(said.split("motion ")[1].split(":")[0])
    (line,) = [each for each in printed.splitlines() if each.startswith(f"  {number} ")]
    assert "proven free" not in line
    assert not rrtik.TaskPlan.load(file).proven


def test_a_line_down_into_the_table_is_not_valid_on_a_contact_as_deep(tmp_path, panda, put_down, capsys):
    low = rrtik.Obstacle("table", TABLE.shape, TABLE.pose.translation - np.array([0.0, 0.0, 0.06]))
    down = planned(panda, scene(table=low), [*taken(), Straight(by=[0.0, 0.0, -0.015])])
    assert down.found, down.reason
    table = next(each for each in put_down.worlds[0].scene.obstacles if each.name == "table")
    worlds = []
    for world in down.worlds:
        others = tuple(each for each in world.scene.obstacles if each.name != "table")
        around = dataclasses.replace(world.scene, obstacles=(table, *others))
        if world.scene.attached:
            around = dataclasses.replace(around, contacts=(rrtik.Touching("cup", "table", -0.02),))
        worlds.append(world.with_scene(around))
    false = dataclasses.replace(down, worlds=tuple(worlds), end=worlds[-1], contacts=())
    false.save(tmp_path / "plan.json")
    assert run(["check", str(tmp_path / "plan.json")]) == 1
    printed = capsys.readouterr().out
    assert "not valid: motion 3: contact of 'cup' and 'table'" in printed
    assert not false.proven


def test_a_loaded_plan_is_proven_if_the_saved_one_was(tmp_path, put_down):
    assert put_down.proven
    put_down.save(tmp_path / "plan.json")
    again = rrtik.TaskPlan.load(tmp_path / "plan.json")
    assert again.violations() == ()
    assert again.proven


@pytest.mark.parametrize("inside", [0.003, 0.01])
def test_a_depth_that_a_grasp_has_named_is_valid_in_the_plan_and_in_its_file(tmp_path, panda, inside):
    plan = planned(panda, scene(inside=inside), [*taken(allow=["table"]), Straight(by=UP)])
    assert plan.violations() == ()
    plan.save(tmp_path / "plan.json")
    assert rrtik.TaskPlan.load(tmp_path / "plan.json").violations() == ()


def test_plans_keep_their_contacts_in_files_copies_and_times(tmp_path, panda):
    plan = planned(panda, scene(), [*taken(), Straight(by=UP), *put(0.0005)])
    assert plan.found, plan.reason
    plan.save(tmp_path / "plan.json")
    for again in (rrtik.TaskPlan.load(tmp_path / "plan.json"), pickle.loads(pickle.dumps(plan))):
        assert again.contacts == plan.contacts
        assert again.notes == plan.notes
        assert [world.scene.contacts for world in again.worlds] == [world.scene.contacts for world in plan.worlds]
        assert again.violations() == ()
    first = json.loads((tmp_path / "plan.json").read_text())
    first["motions"][2]["contacts"][0]["until"] = 0
    first["motions"][2]["contacts"][0].pop("distance")
    (tmp_path / "bad.json").write_text(json.dumps(first))
    with pytest.raises(rrtik.InputError, match="distance"):
        rrtik.TaskPlan.load(tmp_path / "bad.json")
    timed = plan.time_parameterize(pause=0.0)
    samples = timed.trajectory.sample(500.0)
    rows = samples.positions
    clock = samples.times
    grasp = plan.worlds[2].scene.attached[0].pose
    judge = Judge(plan.worlds[2].robot, "panda_hand", (0.05, 0.05, 0.1), [(TABLE.shape, TABLE.pose)])
    carrying = rows[(clock >= timed.begins[2]) & (clock < timed.begins[4])]
    gaps = judge.gaps(plan.worlds[2].robot, carrying, grasp)
    assert gaps.min() >= -1.001e-3
    assert gaps[np.flatnonzero(gaps > 1e-4)[0] :].min() >= 0.0


def test_certificates_stand_on_contacts_and_no_deeper(panda):
    plan = planned(panda, scene(), [*taken(), Straight(by=UP)])
    lift, world = plan.paths[2], plan.worlds[2]
    found = world.certificate(lift)
    assert world.verify(found, lift.waypoints) == ""
    (contact,) = world.scene.contacts
    for other in ((), (dataclasses.replace(contact, distance=0.0),)):
        strict = world.with_scene(dataclasses.replace(world.scene, contacts=other))
        assert strict.verify(found, lift.waypoints).startswith("it is for another scene: 'table'")
        assert strict.certificate(lift) is None


def plate_beside(away):
    plate = rrtik.Obstacle("plate", rrtik.Box([0.05, 0.001, 0.05]), [0.5, 0.25 + away, 0.27])
    stages = [MoveTo(above(0.5, 0.25)), Gripper("close"), Straight(by=DOWN), Gripper("open"), Straight(by=UP)]
    return rrtik.Scene([TABLE, plate]), stages


@pytest.mark.parametrize(("away", "found"), [(0.038, False), (0.07, True)])
def test_fingers_do_not_pass_through_what_is_between_their_places(panda, away, found):
    """At 38 mm the plate is free of the fingers where they are shut and where they are open."""
    if found:
        assert planned(panda, *plate_beside(away)).found
    else:
        words = "contact of the fingers on their way: 'panda_"
        reason = refused(panda, *plate_beside(away), words)
        assert words in reason
        assert "attach the object" in reason


def test_fingers_open_and_close_beside_half_spaces_which_have_no_end(panda):
    _, stages = plate_beside(0.0)
    floor = rrtik.Obstacle("floor", rrtik.HalfSpace([0.0, 0.0, 1.0], -0.01))
    wall = rrtik.Obstacle("wall", rrtik.HalfSpace([0.0, -1.0, 0.0], -0.4))
    assert planned(panda, rrtik.Scene([wall, floor]), stages).found


def test_fingers_may_press_on_what_is_attached_next(panda):
    reach = [MoveTo(above(*PLACE[:2])), Straight(by=DOWN)]
    shut = Gripper("close", width=0.046)
    assert planned(panda, scene(), [*reach, shut, Attach("cup", "panda_hand"), Straight(by=UP)]).found
    assert not planned(panda, scene(), [*reach, shut, Gripper("open"), Straight(by=UP)], seconds=1.0).found


def boxes(sides):
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * sides
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return rrtik.Mesh(corners, faces)


def goblet(segments=12):
    """A hollow cup: a mesh that is not convex."""
    angles = 2.0 * np.pi * np.arange(segments) / segments
    rings = [(0.03, -0.05), (0.03, 0.05), (0.026, 0.05), (0.026, -0.045)]
    points = [[r * np.cos(a), r * np.sin(a), z] for r, z in rings for a in angles] + [[0, 0, -0.05], [0, 0, -0.045]]
    faces = []
    for k, j in ((k, (k + 1) % segments) for k in range(segments)):
        for low in (0, segments, 2 * segments):
            high = low + segments
            faces += [[low + k, low + j, high + j], [low + k, high + j, high + k]]
        faces += [[4 * segments, j, k], [4 * segments + 1, 3 * segments + k, 3 * segments + j]]
    return rrtik.Mesh(points, faces)


HELD = {
    "box": rrtik.Box([0.06, 0.06, 0.1]),
    "cylinder": rrtik.Cylinder(0.03, 0.1),
    "capsule": rrtik.Capsule(0.02, 0.06),
    "sphere": rrtik.Sphere(0.05),
    "prism": rrtik.Prism([[-0.03, -0.03], [0.03, -0.03], [0.03, 0.03], [0.0, 0.0], [-0.03, 0.03]], 0.1),
    "mesh": boxes([0.06, 0.06, 0.1]),
    "goblet": goblet(),
}
UNDER = {
    "box": rrtik.Box([0.3, 0.5, 0.1]),
    "mesh": boxes([0.3, 0.5, 0.1]),
    "prism": rrtik.Prism([[-0.15, -0.25], [0.15, -0.25], [0.15, 0.25], [0.0, 0.1], [-0.15, 0.25]], 0.1),
    "cloud": rrtik.PointCloud(
        [[x, y, 0.045] for x in np.linspace(-0.15, 0.15, 13) for y in np.linspace(-0.25, 0.25, 21)], radius=0.005
    ),
    "heights": rrtik.HeightField(np.full((2, 2), 0.05), cell=0.2),
    "half_space": rrtik.HalfSpace([0.0, 0.0, 1.0], 0.05),
}


@pytest.mark.parametrize("under", UNDER)
@pytest.mark.parametrize("held", HELD)
def test_every_pair_of_shapes_overlaps_by_a_millimetre_at_most(ur5, held, under):
    tip = ur5.fk(STRETCHED).translation
    place = tip - np.array([0.0, 0.0, 0.12])
    if under == "half_space":  # the base stands in it, and may
        table = rrtik.Obstacle("table", UNDER[under], rrtik.pose(place - np.array([0.0, 0.0, 0.1])))
    else:
        table = rrtik.Obstacle("table", UNDER[under], place + np.array([0.05, 0.0, -0.1]))
    allowed = [(link, "table") for link in ur5.link_names if under == "half_space"]
    around = rrtik.Scene([table, rrtik.Obstacle("cup", HELD[held], place)], allowed_collisions=allowed)
    world = rrtik.World(ur5, around)
    lift, sink = ([Attach("cup", ur5.tip), Straight(by=[0.0, 0.0, way])] for way in (0.05, -0.0015))
    plan = Task(lift).plan(world, STRETCHED, seconds=3.0, seed=1)
    assert plan.found, plan.reason
    assert plan.proven
    assert plan.contacts[0][0].until is not None
    assert not Task(sink).plan(world, STRETCHED, seconds=0.3, seed=1).found


@pytest.mark.parametrize("attached_first", [False, True])
@pytest.mark.parametrize(("width", "deep"), [(0.05, False), (0.04, True)])
def test_fingers_that_close_deep_into_what_they_hold_are_named(panda, width, deep, attached_first):
    reach = [MoveTo(above(*PLACE[:2])), Straight(by=DOWN)]
    grasp = [Attach("cup", "panda_hand"), Gripper("close", width=width)]
    plan = planned(panda, scene(), [*reach, *(grasp if attached_first else grasp[::-1]), Straight(by=UP)])
    assert plan.found, plan.reason
    named = [note for note in plan.notes if "mm deep into 'cup'" in note]
    assert len(named) == deep, plan.notes
    if deep:
        assert "finger' closes 5.0" in named[0]


def test_the_note_of_a_motion_that_takes_and_sets_down_tells_both_parts():
    contact = MotionContact(rrtik.Touching("cup", "table", -0.003), 2, -0.001)
    expected = "'cup' and 'table' may overlap by 3 mm, up to waypoint 3, and then 'cup' and 'table' may overlap by 1 mm"
    assert str(contact) == expected


SHEET = rrtik.Obstacle("sheet", rrtik.Box([0.3, 0.3, 0.0005]), [0.5, 0.45, 0.29975])


@pytest.mark.parametrize("inside", [0.0, 0.0003])
def test_a_thin_card_does_not_pass_through_a_thin_sheet(panda, inside):
    """In the middle of the way the two are 0.4 mm deep in each other: half of both thicknesses together."""
    card = rrtik.Obstacle("card", rrtik.Box([0.06, 0.4, 0.0003]), [0.5, 0.35, 0.30015 - inside])
    reach = [MoveTo(above(0.5, 0.18, height=0.17)), Straight(by=[0.0, 0.0, -0.016]), Attach("card", "panda_hand")]
    around = rrtik.Scene([SHEET, card])
    words = "'sheet' and 'card' overlap by 0.3"
    assert words in refused(panda, around, [*reach, Straight(by=[0.0, 0.0, -0.05])], words)
    lifted = planned(panda, around, [*reach, Straight(by=[0.0, 0.0, 0.05])], seconds=20.0 if inside == 0.0 else 1.0)
    assert lifted.found == (inside == 0.0), lifted.reason
    if lifted.found:
        assert lifted.proven
        assert lifted.contacts[2][0].touching.distance == pytest.approx(-0.0002)


def test_a_contact_may_not_be_so_deep_that_two_could_pass_through_each_other(panda):
    card = rrtik.Obstacle("card", rrtik.Box([0.06, 0.4, 0.0003]), [0.5, 0.35, 0.30015])
    for depth in (0.001, 0.00021):
        around = rrtik.Scene([SHEET, card], contacts=[rrtik.Touching("card", "sheet", -depth)])
        with pytest.raises(rrtik.InputError, match=r"too thin.*0\.2 mm"):
            rrtik.World(panda, around)
    rrtik.World(panda, rrtik.Scene([SHEET, card], contacts=[rrtik.Touching("card", "sheet", -0.0002)]))


def tray():
    """A hollow tray, 80 mm high and 20 mm thick, whose bottom is at z = 0: a mesh that is not convex."""
    profile = [
        (-0.1, -0.02),
        (0.1, -0.02),
        (0.1, 0.06),
        (0.08, 0.06),
        (0.08, 0),
        (-0.08, 0),
        (-0.08, 0.06),
        (-0.1, 0.06),
    ]
    count = len(profile)
    points = [(x, y, z) for y in (-0.15, 0.15) for x, z in profile]
    front = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 5), (0, 5, 7), (5, 6, 7)]
    faces = front + [(a + count, c + count, b + count) for a, b, c in front]
    for k in range(count):
        j = (k + 1) % count
        faces += [(k, k + count, j), (j, k + count, j + count)]
    return rrtik.Mesh(points, faces)


def test_a_cup_is_taken_out_of_a_hollow_tray(panda):
    around = rrtik.Scene([rrtik.Obstacle("tray", tray(), [*PLACE[:2], TOP]), rrtik.Obstacle("cup", CUP, PLACE)])
    plan = planned(panda, around, [*taken(), Straight(by=UP)])
    assert plan.found, plan.reason
    assert plan.proven
    assert plan.violations() == ()
    path, world = plan.paths[2], plan.worlds[2]
    assert world.explain(path.start) == ""
    (contact,) = world.scene.contacts
    shallow = world.with_scene(dataclasses.replace(world.scene, contacts=(), allowed_collisions=()))
    assert "'tray' and 'cup'" in shallow.explain(path.start)
    assert contact.pair == {"tray", "cup"}
