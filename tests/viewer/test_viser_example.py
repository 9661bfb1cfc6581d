"""examples/viser_plan.py draws the plan where it is, in viser, or in its stand-in where viser is not installed."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_tests.places import ROOT

pytestmark = pytest.mark.kernels
LONGEST = 40  # lines, as of the other examples
SHARES = 0.0, 0.4, 1.0  # of the motion
SHOWN = f"""
import json, runpy
made = runpy.run_path("examples/viser_plan.py")
motion, clock, frames = made["motion"], made["clock"], made["arm"].frames

postures = []
for share in {SHARES}:
    clock.value = share * motion.duration
    made["show"](None)
    links = {{name: [*frame.position, *frame.wxyz] for name, frame in frames.items() if "/visual/" in name}}
    postures.append([motion(clock.value).positions.tolist(), links])

scene = made["server"].scene
named = scene.added if hasattr(scene, "added") else scene._handle_from_node_name
solids = {{}}
for each in made["problem"].world.scene.obstacles:
    solid = named["/scene/" + each.name]
    solids[each.name] = [solid.vertices.tolist(), [*solid.position, *solid.wxyz]]
print("shown:" + json.dumps([postures, solids], default=float))
"""


@pytest.fixture(scope="module")
def shown():
    stand_in = [] if find_spec("viser") else [str(ROOT / "tests/helpers/stand_ins")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*stand_in, *filter(None, sys.path)])}
    command = [sys.executable, "-c", SHOWN]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "proven free: True" in done.stdout
    return json.loads(done.stdout.split("shown:")[1].splitlines()[0])


def place_of(numbers):
    position, (w, x, y, z) = numbers[:3], numbers[3:]
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(position))


def test_it_is_as_short_as_the_others():
    assert len((ROOT / "examples/viser_plan.py").read_text().splitlines()) <= LONGEST


def test_the_links_are_where_the_arm_is_at_the_time_of_the_slider(shown):
    robot = rrtik.load_problem("panda_shelf").robot
    for q, places in shown[0]:
        for link in ("panda_link2", "panda_link5"):
            drawn = place_of(places[f"pinocchio/visual/{link}_0"])
            assert drawn.isApprox(robot.fk(np.array(q), link), 1e-6)
    first, *_, last = (np.array(q) for q, _ in shown[0])
    assert np.abs(last - first).max() > 0.1


def test_the_obstacles_are_where_they_stand(shown):
    scene = rrtik.load_problem("panda_shelf").world.scene
    assert set(shown[1]) == {each.name for each in scene.obstacles}
    for each in scene.obstacles:
        vertices, place = shown[1][each.name]
        drawn = [place_of(place).act(np.array(vertex)) for vertex in vertices]
        stands = [each.pose.act(vertex) for vertex in each.shape.surface()[0]]
        np.testing.assert_allclose(drawn, stands, atol=1e-6)
