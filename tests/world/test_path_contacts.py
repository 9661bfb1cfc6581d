"""Where bodies touch along a path: the same bodies as the world names there, and nowhere on a free path."""

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.world.judgement import contacts_along


def test_the_stretches_of_a_path_in_which_bodies_touch_are_those_that_the_world_names():
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.2), [1.5, 0.0, 0.0])
    world = rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([ball]))
    route = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.2, 0.0, 0.0]])
    found = contacts_along(world.checks, route)
    assert {contact.names & {"ball"} for contact in found} == {frozenset({"ball"})}
    for contact in found:
        assert 0.0 < contact.begin <= contact.end < 1.0  # of the first motion
        assert contact.deepest.distance < 0.0
        for place in (contact.begin, contact.end):
            touching = world.contacts((1.0 - place) * route[0] + place * route[1])
            assert {name for c in touching for name in (c.first, c.second)} == contact.names
    for share in np.linspace(0.005, 0.995, 100):
        near = any(contact.begin - 0.01 < share < contact.end + 0.01 for contact in found)
        within = any(contact.begin < share < contact.end for contact in found)
        assert within <= bool(world.contacts((1.0 - share) * route[0] + share * route[1])) <= near
    judged = rrtik.JointPath.of(world.robot, route).played(world).judged
    assert judged is not None
    assert len(judged.contacts) == len(found)


def test_a_free_path_and_one_without_a_world_have_no_contacts():
    problem = rrtik.load_problem("planar3_boxes")
    path = rrtik.plan(problem, seed=1).path
    assert contacts_along(problem.world.checks, path.waypoints) == ()
    assert path.played(problem.world).judged.contacts == ()
    assert path.played(None).judged is None


def test_a_posture_that_touches_is_a_stretch_without_length():
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.2), [1.5, 0.0, 0.0])
    world = rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([ball]))
    (contact, *_) = contacts_along(world.checks, np.zeros((1, 3)))
    assert contact.begin == 0.0
    assert "ball" in contact.names
