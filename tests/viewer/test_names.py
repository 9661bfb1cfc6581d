"""Each thing has a node of its own in a page, whatever it is called, and the page's scripts find it there."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.choices import TickEvent
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes, link_parts, node_name, nodes_of
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.run_story import run_story
from rrtik_ompl.viewer.subject import subject_of
from rrtik_tests.browser import planning_page
from rrtik_tests.crane import WAYPOINTS
from rrtik_tests.programs import needs_chromium

# Steps of paths, what escapes are written with, what JavaScript's objects have, words of the page, and markup.
PIECES = ["", "/", "|", "%", "%2F", "%25", "\\", " ", ".", "..", ":", "a"]
WORDS = ["constructor", "__proto__", "toString", "margin", "tip frame", "</script><b>&amp;", '"', "Stütze 漢"]
NAMES = sorted({"".join(pair) for pair in product(PIECES, repeat=2)} | set(WORDS))


def boxes(names: list[str]) -> tuple[rrtik.Obstacle, ...]:
    """One small box for each name, all in different places outside the crane's reach."""
    places = [rrtik.pose([3.0 + 0.3 * (k % 12), 0.3 * (k // 12), 0.0]) for k in range(len(names))]
    return tuple(map(rrtik.Obstacle, names, [rrtik.Box([0.1, 0.1, 0.1])] * len(names), places))


def held(names: list[str]) -> tuple[rrtik.AttachedObject, ...]:
    ball = rrtik.Sphere(0.02)
    return tuple(rrtik.AttachedObject(name, "hand", ball, rrtik.pose([0, 0, 0.1 * k])) for k, name in enumerate(names))


def test_different_names_have_different_nodes_each_one_step_of_a_path() -> None:
    nodes = [node_name(name) for name in NAMES]
    assert len(set(nodes)) == len(NAMES)
    assert not any("/" in node or node in ("", ".", "..") for node in nodes)


def test_every_obstacle_and_everything_held_is_drawn(crane: rrtik.Robot) -> None:
    scene = rrtik.Scene(boxes(NAMES), held(["held", *(f"held {name}" for name in NAMES)]))
    recording, _ = draw(subject_of(rrtik.World(crane, scene)))
    drawn = [path for path in recording.paths if "/obstacles/" in path]
    assert drawn == [f"/meshcat/obstacles/{node_name(name)}" for name in NAMES]
    hand = f"/meshcat/robot/{joint_nodes(crane)[-1]}/held"
    assert sum(path.startswith(hand) for path in recording.paths) == len(NAMES) + 1


def test_what_is_held_is_not_drawn_in_place_of_a_link(tmp_path: Path) -> None:
    shape = "<geometry><box size='0.1 0.1 0.1'/></geometry>"
    (tmp_path / "arm.urdf").write_text(
        f"<robot name='arm'><link name='base'/><link name='attached cup'><collision>{shape}</collision></link>"
        "<joint name='turn' type='continuous'><parent link='base'/><child link='attached cup'/></joint></robot>"
    )
    arm = rrtik.load_robot(tmp_path / "arm.urdf", tip="attached cup")
    names = [str(body.name) for body in arm.collision.geometryObjects]
    names += [name.removeprefix("attached ") for name in names]
    cups = [rrtik.AttachedObject(name, "attached cup", rrtik.Sphere(0.1)) for name in names]
    recording, _ = draw(subject_of(rrtik.World(arm, rrtik.Scene(attached=cups))))
    below = f"/meshcat/robot/{joint_nodes(arm)[1]}/"
    assert sum(path.startswith(below) and "tip frame" not in path for path in recording.paths) == 1 + len(cups)


@pytest.mark.parametrize("name", ["ur5", "panda", "titan4", "planar3"])
def test_the_parts_of_a_joint_have_different_nodes(name: str) -> None:
    places = [(part.joint, part.name) for part in link_parts(rrtik.load_robot(name))]
    assert len(set(places)) == len(places)


def test_a_run_moves_each_obstacle_by_its_own_node(crane: rrtik.Robot) -> None:
    scene = rrtik.Scene(boxes(NAMES))
    event: TickEvent = "wait"
    places = {obstacle.name: np.array([0, 0, k, 0, 0, 0, 1.0]) for k, obstacle in enumerate(scene.obstacles)}
    ticks = [Tick(float(time), WAYPOINTS[0], event, None, places, {}) for time in range(2)]
    run = ReplanRun("p", "r", crane.joint_names, "x", 0, 1.0, 1.0, 0.0, None, ticks)
    subject = subject_of(rrtik.World(crane, scene))
    moving = run_story(run, crane, scene, draw(subject)[1])["moving"]
    heights = {name: moving[node_name(name)]["poses"][0][2] for name in NAMES}
    assert heights == {name: places[name][2] for name in NAMES}


def test_contacts_find_the_nodes_of_their_bodies(crane: rrtik.Robot) -> None:
    scene = rrtik.Scene(boxes(NAMES), held([f"cup {name}" for name in NAMES]))
    recording, _ = draw(subject_of(rrtik.World(crane, scene)))
    for name in NAMES:
        for wanted in (name, f"cup {name}"):
            (steps,) = nodes_of(crane, scene, {wanted})
            assert "/".join(["/meshcat", *steps]) in recording.paths


@pytest.mark.slow
@needs_chromium
def test_a_browser_finds_each_obstacle_where_it_stands(crane: rrtik.Robot, tmp_path: Path) -> None:
    scene = rrtik.Scene(boxes(NAMES), held(["a/b", "a|b"]))
    text = page(SimpleNamespace(world=SimpleNamespace(robot=crane, scene=scene)))
    look = """story.obstacles.map(({ name, node: at }) => {
      const group = node("obstacles", at);
      const solids = group.children.filter((child) => child.isMesh).length;
      return [name, solids, group.position.x, group.position.y];
    })"""
    with planning_page(text, tmp_path, "document.documentElement.dataset.ready") as browser:
        found = browser.ask(f"JSON.stringify({look})")
        browser.ask('(setLabels("obstacle", true), node("obstacles", story.obstacles[1].node).visible = false, 1)')
        hidden = """(placeLabels(), JSON.stringify(labels.filter((each) => each.kind === "obstacle").map(
          (each) => each.element.hidden)))"""
        without_name = json.loads(browser.ask(hidden))
        hand = browser.ask('node("robot", robot.nodes.at(-1)).children.filter((c) => c.name.startsWith("held")).length')
    expected = [[o.name, 1, *o.pose.translation[:2].round(9)] for o in scene.obstacles]
    for one, other in zip(json.loads(found), expected, strict=True):
        assert one[:2] == other[:2]
        assert one[2:] == pytest.approx(other[2:], abs=1e-6)
    assert without_name == [k == 1 for k in range(len(expected))], "what is not shown has no name"
    assert hand == 2
