"""A planner's search in a page: what is drawn of large trees, the joint space, and how it grows in a browser."""

import gzip
import json
import re
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.search_story import CELLS, MOST_EDGES, search_story
from rrtik_tests.page_pictures import opened
from rrtik_tests.programs import needs_chromium

LENGTHS = np.array([1.0, 0.8])
RADIUS = 0.04
BALLS = np.array([[1.1, 0.9, 0.25], [-0.3, 1.3, 0.2], [0.9, -0.9, 0.2]])  # x, y and radius


@pytest.fixture(scope="module")
def problem():
    arm = rrtik.load_robot("planar", parameters={"lengths": LENGTHS.tolist(), "radius": RADIUS})
    balls = [rrtik.Obstacle(f"ball {k}", rrtik.Sphere(r), [x, y, 0.0]) for k, (x, y, r) in enumerate(BALLS)]
    return rrtik.Problem(rrtik.World(arm, rrtik.Scene(balls)), [-0.3, 0.4], [2.6, -0.6], name="two joints")


def of_page(text):
    packed = re.search(r'id="search" type="application/gzip">\n(.*)\n', text).group(1)
    return json.loads(gzip.decompress(b64decode(packed)))


def random_tree(count, seed=0):
    rng = np.random.default_rng(seed)
    edges = np.array([[rng.integers(k), k] for k in range(1, count)])
    none = np.zeros(0, dtype=np.int64)
    return SearchTree("random", rng.normal(size=(count, 3)), edges, edges[:, 1], np.zeros(1, dtype=np.int64), none)


@pytest.mark.parametrize("count", [2, 500, 20_000])
def test_of_a_large_tree_whole_branches_are_drawn_and_it_is_said(count):
    story = search_story(random_tree(count))
    (part,) = story["parts"]
    assert part["count"] == count - 1
    assert len(part["edges"]) <= MOST_EDGES
    assert story["note"] == ("" if count < MOST_EDGES else f"{len(part['edges'])} of {count - 1} edges drawn")
    assert count < MOST_EDGES or len(part["edges"]) > MOST_EDGES / 4
    root = 0  # the oldest vertex that is kept
    grown = {root}
    for first, second in part["edges"]:
        assert first in grown
        grown.add(second)


def test_what_is_blocked_in_the_joint_space_is_what_touches_a_ball(problem):
    """By the distance of the balls' middles from the links, as lines in the plane."""
    joints = of_page(page(problem, still=True))["joints"]
    low, high = np.array(joints["low"]), np.array(joints["high"])
    blocked = np.zeros((CELLS, CELLS), dtype=bool)
    for begin, row, length in re.findall(r"M(\d+) (\d+)h(\d+)v1H\d+z", joints["blocked"]):
        blocked[int(row), int(begin) : int(begin) + int(length)] = True

    first, second = (low[k] + (high[k] - low[k]) * (np.arange(CELLS) + 0.5) / CELLS for k in (0, 1))
    q1, q2 = np.meshgrid(first, second)
    elbow = LENGTHS[0] * np.stack([np.cos(q1), np.sin(q1)], axis=-1)
    tip = elbow + LENGTHS[1] * np.stack([np.cos(q1 + q2), np.sin(q1 + q2)], axis=-1)
    touching = np.zeros_like(blocked)
    for x, y, radius in BALLS:
        for a, b in ((np.zeros_like(elbow), elbow), (elbow, tip)):
            along = ((np.array([x, y]) - a) * (b - a)).sum(axis=-1) / ((b - a) ** 2).sum(axis=-1)
            nearest = a + np.clip(along, 0.0, 1.0)[..., None] * (b - a)
            touching |= np.hypot(*np.moveaxis(nearest - [x, y], -1, 0)) < radius + RADIUS
    free_of_itself = np.abs(q2) < 3.0  # folded links touch each other
    assert touching.any()
    assert np.array_equal(blocked[free_of_itself], touching[free_of_itself])


def test_a_roadmap_and_a_tree_are_drawn_as_they_are(problem):
    roadmap = rrtik.Roadmap(problem.world, vertices=60, seed=1)
    (part,) = of_page(page(problem, tree=roadmap, still=True))["tree"]["parts"]
    assert part["count"] == len(roadmap.edges)
    assert of_page(page(rrtik.load_robot("panda")))["tree"] is None


def test_a_plan_stands_for_its_problem_path_and_tree(problem, tmp_path):
    plan = rrtik.plan(problem, "crdt", seed=1, tree=True)
    rrtik.view(plan, html=tmp_path / "plan.html", still=True)
    text = (tmp_path / "plan.html").read_text()
    assert of_page(text)["tree"]["planner"] == "crdt"
    rrtik.view(plan, html=tmp_path / "none.html", still=True, tree=False)
    assert of_page((tmp_path / "none.html").read_text())["tree"] is None

    ordinary = rrtik.plan(problem, "crdt", seed=1)
    with pytest.raises(rrtik.InputError, match=r"plan\(problem, tree=True\) keeps it"):
        rrtik.view(ordinary, html=tmp_path / "no.html", tree=True)
    with pytest.raises(rrtik.InputError, match="a Plan has its own"):
        rrtik.view(plan, plan.path, html=tmp_path / "no.html")
    with pytest.raises(rrtik.InputError, match="of an arm of 2 joints, not of robot 'panda' of 7"):
        rrtik.view(rrtik.load_robot("panda"), tree=plan.tree, html=tmp_path / "no.html")
    with pytest.raises(rrtik.InputError, match="expected plan"):
        rrtik.view(problem, tree=[1, 2], html=tmp_path / "no.html")
    assert not (tmp_path / "no.html").exists()


@pytest.mark.slow
@needs_chromium
def test_the_search_grows_step_by_step_and_goes_with_another_path(problem, tmp_path):
    plan = rrtik.plan(problem, "crdt", seed=1, tree=True)
    file = Path(rrtik.view(plan, html=tmp_path / "plan.html")).as_uri()
    drawn = "growing[0].mesh.geometry.drawRange.count"
    moves = "(document.querySelector('#joint-space .tree').getAttribute('d').match(/M/g) ?? []).length"
    with opened(file) as browser:
        assert browser.ask(f"{drawn} === growing[0].mesh.geometry.index.count")
        assert browser.ask(moves) == len(plan.tree.edges)
        browser.ask("showSearch(3)")
        edges = int((plan.tree.steps <= 3).sum())
        assert browser.ask(moves) == edges
        assert browser.ask(f"{drawn} === growing[0].ends[{edges - 1}]")
        assert browser.ask("things.filter(({ group }) => group === 'search').length") == 1

        browser.ask("kept = []; keepFile = (name, blob) => kept.push([name, blob]); keepPlots()")
        assert sorted(browser.ask("kept.map(([name]) => name)")) == ["clearance.svg", "joint-space.svg"]

        browser.ask("replacePath([state.start, state.goal])")
        assert browser.ask("document.getElementById('search-section').hidden && growing.length === 0")
        assert browser.ask("things.filter(({ group }) => group === 'search').length") == 0
