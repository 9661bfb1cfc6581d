"""Scenes made from scenes."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError

BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [0.5, 0.0, 0.5])
BOX = rrtik.Obstacle("box", rrtik.Box([0.1, 0.1, 0.1]), [0.5, 0.5, 0.5])
SCENE = rrtik.Scene([BALL, BOX], allowed_collisions=[("ball", "wrist")])


def test_a_colour_goes_with_an_obstacle_that_is_taken_and_set_down():
    cup = rrtik.Obstacle("cup", rrtik.Sphere(0.1), color=[1.0, 0.0, 0.0])
    held = rrtik.Scene([cup]).attaching("cup", "hand")
    down = held.detaching("cup", rrtik.pose([1.0, 0.0, 0.0]))
    assert [cup.color, held.attached[0].color, down.obstacles[0].color] == ["#ff0000"] * 3


@pytest.mark.parametrize("color", ["red", "#12345", "#12345g", [0.0, 1.0], [0.0, 0.0, 1.1], [0.0, 0.0, np.nan], 7])
def test_what_is_no_colour_is_refused(color):
    with pytest.raises(rrtik.InputError, match="color of 'a'"):
        rrtik.Obstacle("a", rrtik.Sphere(0.1), color=color)


def test_obstacles_come_and_go_and_the_scene_stays_as_it_was():
    more = SCENE.with_(rrtik.Obstacle("post", rrtik.Sphere(0.2)))
    assert more.names == ("ball", "box", "post")
    assert more.without("box", "post").names == ("ball",)
    assert more.without("box").allowed_collisions == (("ball", "wrist"),)
    assert more.without("ball").allowed_collisions == ()
    assert SCENE.names == ("ball", "box")


def test_an_obstacle_is_held_and_let_go():
    held = SCENE.attaching("ball", "gripper", allow=["box", "wrist"], pose=[0.0, 0.0, 0.1])
    assert [o.name for o in held.obstacles] == ["box"]
    (item,) = held.attached
    assert (item.name, item.link, item.allow, item.shape) == ("ball", "gripper", ("box", "wrist"), BALL.shape)
    assert np.allclose(item.pose.translation, [0.0, 0.0, 0.1])
    assert held.allowed_collisions == SCENE.allowed_collisions == (("ball", "wrist"),)
    free = held.detaching("ball", pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))
    assert free.attached == ()
    assert np.allclose(free.obstacle("ball").pose.translation, [1.0, 0.0, 0.0])
    assert free.allowed_collisions == SCENE.allowed_collisions


def test_contacts_of_what_is_held_end_with_the_grasp_and_others_stay():
    contacts = (rrtik.Touching("ball", "box", -0.001), rrtik.Touching("wrist", "box", -0.002))
    held = rrtik.Scene([BALL, BOX], contacts=contacts).attaching("ball", "gripper")
    assert held.contacts == contacts
    assert held.detaching("ball", [0.0, 0.0, 1.0]).contacts == contacts[1:]
    assert held.without("box").contacts == ()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rrtik.Touching("cup", "cup", 0.0), "'cup' stands twice"),
        (lambda: rrtik.Touching("cup", "table", np.nan), "distance of 'cup' and 'table'"),
        (lambda: rrtik.Touching("cup", "table", 0.02), "distance of 'cup' and 'table' must not be above 0, got 0.02"),
        (lambda: rrtik.Touching("cup", 3, 0.0), "name of a thing that touches another"),
        (
            lambda: rrtik.Scene(contacts=[rrtik.Touching("a", "b", 0.0), rrtik.Touching("b", "a", -0.001)]),
            "'a' and 'b' stand there 2 times; keep one",
        ),
        (lambda: rrtik.Scene([BALL], contacts=[("ball", "box")]), "each contact of a scene"),
    ],
)
def test_contacts_that_are_none_are_refused_in_a_line(make, words):
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_what_is_not_there_or_there_twice_is_refused():
    with pytest.raises(UnknownNameError, match=r"no .*'bal'"):
        SCENE.without("bal")
    with pytest.raises(UnknownNameError, match="no obstacle 'cup'"):
        SCENE.attaching("cup", "gripper")
    with pytest.raises(UnknownNameError, match="no attached object 'ball'"):
        SCENE.detaching("ball", [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="used 2 times"):
        SCENE.with_(BALL)


@pytest.mark.parametrize("time", [float("nan"), float("inf"), "x", [0, 1], 1e300])
def test_a_motion_is_not_seen_from_a_time_that_is_none(time):
    motion = rrtik.replanning.TimedPoses([0.0, 1.0], [rrtik.pose([0, 0, 0]), rrtik.pose([1, 0, 0])])
    moving = rrtik.Scene([rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([0, 0, 0]), motion=motion)])
    with pytest.raises(rrtik.InputError):
        motion.seen_from(time)
    with pytest.raises(rrtik.InputError):
        moving.at(time)
