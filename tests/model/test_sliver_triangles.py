"""Triangles that rounding alone keeps from being none: nothing far away touches them."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.model.shapes.surfaces import revolved


def ball_of_triangles():
    """The poles are rings of a radius of 6e-17 m, with slivers between their corners."""
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 7)
    return rrtik.Mesh(*revolved(0.2 * np.cos(latitude), 0.2 * np.sin(latitude), 9))


def test_vertices_that_differ_by_rounding_are_one_and_the_mesh_is_closed():
    mesh = ball_of_triangles()
    assert (len(mesh.vertices), len(mesh.triangles), mesh.closed) == (5 * 9 + 2, 9 * 2 * 5, True)


def test_vertices_a_nanometre_apart_stay_two():
    corners = [[0, 0, 0], [1, 0, 0], [1, 1e-9, 0], [0, 0, 1]]
    assert len(rrtik.Mesh(corners, [[0, 1, 3], [1, 2, 3], [2, 0, 3]]).vertices) == 4


@pytest.mark.parametrize("gap", [1e-3, 1e-5])
def test_a_ball_beside_the_mesh_is_as_far_away_as_it_is(gap):
    robot = rrtik.load_robot("planar", parameters={"lengths": [1.0], "limits_deg": [[-90, 90]], "radius": 0.05})
    link = robot.link_names[-1]
    held = rrtik.AttachedObject("held", link, ball_of_triangles(), rrtik.pose([0.0, 0.0, 0.5]))
    above = np.add(robot.fk([0.0], link).translation, [0.0, 0.0, 0.8 + gap])
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose(above))
    world = rrtik.World(robot, rrtik.Scene([ball], [held]))
    assert world.valid([0.0])
    assert world.clearance([0.0]) == pytest.approx(gap, abs=1e-6)
