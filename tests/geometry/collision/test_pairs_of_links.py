"""Which links are compared: all but those that one joint joins, and solids that always touch; by Pinocchio and coal."""

import pickle
import warnings
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import DescriptionWarning
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.world.world import World

CYLINDER = '<origin xyz="0 0 -.2"/><geometry><cylinder radius=".04" length=".4"/></geometry>'
BLADE = '<origin xyz="0 0 .16"/><geometry><box size=".02 .02 .2"/></geometry>'
BALL = '<origin xyz="0 0 {}"/><geometry><sphere radius="{}"/></geometry>'
AXES = ("1 0 0", "0 0 1", "0 1 0")


def arm(*links):
    """Links one after the other, each with its solids; between any two a joint that turns."""
    names = [f"l{k}" for k in range(len(links))]
    parts = [
        f'<link name="{name}">{"".join(f"<collision>{solid}</collision>" for solid in solids)}</link>'
        for name, solids in zip(names, links, strict=True)
    ]
    parts += [
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="{AXES[k % 3]}"/>'
        '<limit lower="-3.1" upper="3.1" velocity="1" effort="1"/></joint>'
        for k in range(len(links) - 1)
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def srdf(tmp_path, content):
    file = tmp_path / "arm.srdf"
    file.write_text(f'<robot name="arm">{content}</robot>')
    return file


def touching(text, q):
    """Pairs of links that touch at a posture, of which no joint lies between directly, by Pinocchio and coal alone."""
    model = pin.buildModelFromXML(text)
    solids = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    data = model.createData()
    pin.forwardKinematics(model, data, np.asarray(q))
    found = set()
    for a, b in combinations(solids.geometryObjects, 2):
        if abs(a.parentJoint - b.parentJoint) < 2:
            continue
        poses = [data.oMi[each.parentJoint] * each.placement for each in (a, b)]
        ends = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
        if coal.collide(a.geometry, ends[0], b.geometry, ends[1], coal.CollisionRequest(), coal.CollisionResult()):
            found.add((a.parentJoint, b.parentJoint))
    return found


@pytest.mark.parametrize("between", [1, 2, 3])
def test_links_without_solids_make_no_neighbours_of_those_beside_them(between):
    text = arm([], [CYLINDER], *[[]] * between, [BLADE])
    robot = robot_from_urdf_text(text)
    world = World(robot)
    assert len(world.pairs) == 1
    Q = np.random.default_rng(between).uniform(robot.lower, robot.upper, (300, robot.dof))
    expected = [not touching(text, q) for q in Q]
    assert 10 < sum(expected) < 290
    assert world.valid_batch(Q).tolist() == expected


def test_neighbours_are_not_compared_unless_an_srdf_asks_for_it(tmp_path):
    text = arm([], [CYLINDER], [BLADE])
    assert World(robot_from_urdf_text(text)).pairs == ()
    asked = '<enable_collisions link1="l1" link2="l2"/>'
    robot = robot_from_urdf_text(text, srdf=srdf(tmp_path, asked))
    assert len(World(robot).pairs) == 1
    assert World(robot).valid([0.0, 0.0])
    assert World(pickle.loads(pickle.dumps(robot))).pairs == World(robot).pairs
    both = asked + '<disable_collisions link1="l1" link2="l2"/>'  # which has the last word in MoveIt
    assert World(robot_from_urdf_text(text, srdf=srdf(tmp_path, both))).pairs == ()


def test_of_links_that_always_touch_only_the_solids_that_do_are_left_out_and_named():
    """A hub of two balls, of which one holds the far link's near ball for ever; its far ball comes back to the hub."""
    hub, far = [BALL.format(0, 0.05), BALL.format(-0.3, 0.03)], [BALL.format(0, 0.05), BALL.format(0.3, 0.03)]
    text = arm([], hub, [], far)
    robot = robot_from_urdf_text(text)
    with pytest.warns(DescriptionWarning, match=r"'arm'.*'l1' \(solid 1\).*'l3' \(solid 1\); correct"):
        world = World(robot)
    assert len(world.pairs) == 3
    assert world.valid([0.0, 0.0, 0.0])
    assert not world.valid([0.0, 0.0, np.pi - 0.05])
    with warnings.catch_warnings():
        warnings.simplefilter("error", DescriptionWarning)  # said once for a robot
        World(robot)


def test_links_that_always_touch_over_one_without_solids_refuse_no_robot_that_has_an_srdf(tmp_path):
    ball = [BALL.format(0, 0.05)]
    file = srdf(tmp_path, '<disable_collisions link1="l0" link2="l1"/>')
    robot = robot_from_urdf_text(arm(ball, ball, [], ball), srdf=file)
    with pytest.warns(DescriptionWarning, match="'l1' and 'l3'"):
        assert not World(robot).valid(np.zeros(3))  # l0 and l3, which the file does not let touch
    also = srdf(
        tmp_path,
        '<disable_collisions link1="l0" link2="l3"/>',
    )
    robot = robot_from_urdf_text(arm(ball, ball, [], ball), srdf=also)
    with pytest.warns(DescriptionWarning, match="'l1' and 'l3'"):
        assert World(robot).valid(np.zeros(3))


BOX = '<collision><origin xyz="{}"/><geometry><box size="{}"/></geometry></collision>'
BESIDE = """<robot name="arm"><link name="base"/><link name="l1">{arm}</link><link name="camera">{cube}</link>
<link name="l2">{arm}</link>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/>{limit}</joint>
<joint name="jc" type="{kind}"><parent link="l1"/><child link="camera"/><origin xyz=".5 .2 0"/>{limit}</joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz=".5 0 0"/><axis xyz="0 0 1"/>{limit}
</joint></robot>"""
LIMIT = '<limit lower="-3" upper="3" velocity="1" effort="1"/>'
NEIGHBOURS = '<disable_collisions link1="l1" link2="l2"/><disable_collisions link1="l1" link2="camera"/>'


def beside(kind):
    """Two links, and a camera beside the joint between them, which is fixed to the first or held there."""
    return BESIDE.format(arm=BOX.format(".25 0 0", ".4 .05 .05"), cube=BOX.format("0 0 0", ".05 .05 .05"),
                         limit=LIMIT, kind=kind)  # fmt: skip


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_what_is_fixed_to_a_link_is_compared_with_the_links_that_move_against_it(tmp_path, kind, listed):
    options = {"srdf": srdf(tmp_path, NEIGHBOURS)} if listed else {}
    robot = robot_from_urdf_text(beside(kind), joints=["j1", "j2"], tip="l2", **options)
    world = World(robot)
    assert [{world.bodies[k].name for k in pair} for pair in world.pairs] == [{"camera", "l2"}]
    assert not world.valid([0.0, np.pi / 2])
    assert world.valid([0.0, 0.0])
    assert not world.prove([[0.0, -1.0], [0.0, 2.5]]).proven


def test_what_an_srdf_lets_touch_beside_a_joint_is_not_compared(tmp_path):
    both = NEIGHBOURS + '<disable_collisions link1="camera" link2="l2"/>'
    robot = robot_from_urdf_text(beside("fixed"), srdf=srdf(tmp_path, both), tip="l2")
    assert World(robot).pairs == ()


FRAMED = """<robot name="arm">{links}{joints}</robot>"""
FIXED = '<joint name="f{0}" type="fixed"><parent link="{1}"/><child link="{2}"/><origin xyz="0 0 {3}"/></joint>'
TURN = '<joint name="j{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><axis xyz="1 0 0"/>{3}</joint>'


@pytest.mark.parametrize("cameras", [0, 1])
def test_a_frame_is_part_of_the_link_that_it_is_fixed_to_if_there_is_one(cameras):
    """The upper link ends in a flange, the lower one begins with one; a camera at a flange makes it no one's."""
    solid = BOX.format("0 0 0", ".02 .02 .2")
    links = ["base", "above", "flange", "start", "below", *["camera"] * cameras]
    text = FRAMED.format(
        links="".join(f'<link name="{name}">{"" if name in ("flange", "start") else solid}</link>' for name in links),
        joints=TURN.format(1, "base", "above", LIMIT) + FIXED.format(1, "above", "flange", 0.2)
        + TURN.format(2, "flange", "start", LIMIT) + FIXED.format(2, "start", "below", 0.2)
        + (FIXED.format(3, "flange", "camera", 0.0) if cameras else ""),
    )  # fmt: skip
    world = World(robot_from_urdf_text(text, tip="below"))
    found = {frozenset(world.bodies[k].name for k in pair) for pair in world.pairs}
    expected = {("base", "below")} | (
        {("base", "camera"), ("camera", "below"), ("above", "below")} if cameras else set()
    )
    assert found == {frozenset(pair) for pair in expected}


def drawn(rng):
    """A tree of links, each with a box, at random joints: URDF text, and of each joint parent, child and whether held.

    Joints are fixed (held is None), or turn and are held still, or turn.
    """
    count = int(rng.integers(4, 7))
    joints = [(int(rng.integers(max(0, k - 2), k)), k, rng.choice([None, True, False, False])) for k in range(1, count)]
    joints[-1] = (*joints[-1][:2], False)
    parts = [
        f'<link name="l{k}">{BOX.format(_text(rng.uniform(-0.1, 0.1, 3)), _text(rng.uniform(0.02, 0.1, 3)))}</link>'
        for k in range(count)
    ]
    for parent, child, held in joints:
        kind = "fixed" if held is None else "revolute"
        parts.append(
            f'<joint name="j{child}" type="{kind}"><parent link="l{parent}"/><child link="l{child}"/>{LIMIT}'
            f'<origin xyz="{_text(rng.uniform(-0.15, 0.15, 3))}"/><axis xyz="{AXES[child % 3]}"/></joint>'
        )
    return f'<robot name="drawn">{"".join(parts)}</robot>', joints


def _text(numbers):
    return " ".join(f"{number:.4f}" for number in numbers)


def rigid_parts(joints):
    """For each link the least link that no joint which moves parts from it."""
    part = {0: 0}
    for parent, child, held in joints:
        part[child] = child if held is False else part[parent]
    return part


@pytest.mark.parametrize("seed", range(12))
def test_links_are_compared_unless_one_joint_of_the_description_joins_them_or_none_moves_them_apart(seed):
    rng = np.random.default_rng(seed)
    text, joints = drawn(rng)
    moving = [f"j{child}" for _, child, held in joints if held is False]
    robot = robot_from_urdf_text(text, joints=moving, tip=f"l{joints[-1][1]}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DescriptionWarning)
        world = World(robot)
    model = pin.buildModelFromXML(text)
    solids = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    places = [model.joints[model.getJointId(name)].idx_q for name in moving]
    part, joined = rigid_parts(joints), {(parent, child) for parent, child, held in joints if held is not None}
    solids.addAllCollisionPairs()
    pairs = [{int(solids.geometryObjects[k].name[1]) for k in (p.first, p.second)} for p in solids.collisionPairs]
    counted = [k for k, (a, b) in enumerate(map(sorted, pairs)) if part[a] != part[b] and (a, b) not in joined]
    Q = rng.uniform(robot.lower, robot.upper, (200, robot.dof))
    full = np.tile(pin.neutral(model), (200, 1))
    full[:, places] = Q
    data, found = model.createData(), pin.GeometryData(solids)
    touch = np.zeros((200, len(pairs)), dtype=bool)
    for row, q in enumerate(full):
        pin.computeCollisions(model, data, solids, found, q, False)
        touch[row] = [result.isCollision() for result in found.collisionResults]
    always = [k for k in counted if touch[:, k].all()]
    kept = sorted(sorted(pairs[k]) for k in counted if k not in always)
    assert sorted(sorted(int(world.bodies[k].name[1:]) for k in pair) for pair in world.pairs) == kept
    expected = ~touch[:, [k for k in counted if k not in always]].any(axis=1)
    assert (world.valid_batch(Q) == expected).all()
