"""In a browser the page shows what it should."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl
from rrtik_ompl.base.colors import fractions
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.page import page
from rrtik_tests.crane import WAYPOINTS
from rrtik_tests.page_pictures import document_of, screenshot


def share_of(color: str, picture: np.ndarray, likeness: float) -> float:
    """Share of pixels of a hue, whatever their lightness."""
    wanted = np.array(fractions(color))
    wanted = (wanted - wanted.mean()) / np.linalg.norm(wanted - wanted.mean())
    tint = picture - picture.mean(axis=2, keepdims=True)
    strength = np.linalg.norm(tint, axis=2)
    alike = (tint @ wanted) > likeness * strength
    return float((alike & (strength > 25.0)).mean())


@pytest.fixture
def file(text: str, tmp_path: Path) -> Path:
    target = tmp_path / "view.html"
    target.write_text(text, encoding="utf-8")
    return target


@pytest.mark.slow
def test_a_browser_shows_obstacles_trail_ghosts_and_a_robot_that_moves(file: Path) -> None:
    at_start, later = screenshot(file, ""), screenshot(file, "#waypoint=2")
    for picture in (at_start, later):
        assert share_of(palette.OBSTACLE, picture, 0.985) > 0.005
        assert share_of(palette.TRAIL, picture, 0.99) > 0.0005
        assert share_of(palette.GOAL, picture, 0.9) > 0.001
        assert (picture.max(axis=2) < 170).mean() > 0.005
    assert share_of(palette.START, later, 0.9) > 0.001
    assert (np.abs(at_start - later).max(axis=2) > 30).mean() > 0.005


@pytest.mark.slow
def test_the_ground_of_the_page_hides_no_floor_of_the_scene(tmp_path: Path) -> None:
    target = tmp_path / "view.html"
    floor = rrtik_ompl.Obstacle("floor", rrtik_ompl.HalfSpace([0.0, 0.0, 1.0], offset=-0.02), color="#cc3366")
    world = rrtik_ompl.World(rrtik_ompl.load_robot("panda_primitives"), rrtik_ompl.Scene([floor]))
    target.write_text(page(world), encoding="utf-8")
    assert share_of("#cc3366", screenshot(target, ""), 0.95) > 0.1


def test_the_page_reads_degrees_metres_and_the_tip_where_the_robot_has_it(file: Path, crane: Robot) -> None:
    shown = document_of(f"{file.as_uri()}#waypoint=3").replace("\u2212", "-")
    assert re.search(r">slew</td><td[^>]*>68\.8 deg</td><td[^>]*>\u2192 -57\.3<", shown)
    assert re.search(r">hoist</td><td[^>]*>0\.700 m</td>", shown)
    assert re.search(r">spin</td><td[^>]*>229\.2 deg</td>", shown)
    assert "Move 4 of 4: slew 68.8 \u2192 -57.3 deg" in shown
    x, y, z = crane.fk(WAYPOINTS[3]).translation
    assert f"tip (hand): x {x:.3f}, y {y:.3f}, z {z:.3f} m" in shown


@pytest.mark.usefixtures("coarse_arms")
def test_the_page_shows_the_clearance_along_the_path_and_what_is_not_proven(tmp_path: Path) -> None:
    problem = rrtik_ompl.load_problem("titan4_sdu")
    path = rrtik_ompl.plan(problem, "RRTConnect", seed=1).path
    through = np.vstack([path.waypoints, path.start])  # straight back, through the shelf
    for rows, said in ((path.waypoints, "every move is proven free"), (through, "1 move not proven free (violet)")):
        target = tmp_path / "view.html"
        target.write_text(page(problem, rows), encoding="utf-8")
        shown = document_of(target.as_uri())
        assert said in shown
        assert re.search(r"now [0-9.]+ mm: \w+ and \w+; least [0-9.]+ mm: \w+ and \w+", shown)
        assert shown.count('class="unproven"') == (rows is through)
