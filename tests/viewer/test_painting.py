"""Colours of obstacles that state none."""

from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, HalfSpace, Sphere
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.painting import obstacle_colors


def test_table_wall_and_cup_differ_and_things_of_one_kind_do_not():
    things = [
        Obstacle("cup 1", Sphere(0.05)),
        Obstacle("table", Box([1.0, 1.0, 0.1])),
        Obstacle("wall", Box([0.1, 0.5, 0.5])),
        Obstacle("left cup", Sphere(0.06)),
        Obstacle("floor", HalfSpace([0.0, 0.0, 1.0])),
        Obstacle("sign", Sphere(0.2), color="#123456"),
    ]
    colors = obstacle_colors(things)
    assert colors["table"] == palette.OBSTACLE
    assert colors["cup 1"] == colors["left cup"]
    assert colors["sign"] == "#123456"
    assert len(set(colors.values())) == 5


def test_there_are_enough_colours_for_any_scene():
    things = [Obstacle("abcdefghijklmnopqrstuvwxyz"[k] * 3, Sphere(0.1)) for k in range(26)]
    assert set(obstacle_colors(things).values()) == set(palette.OBSTACLES)
