"""MuJoCo plays a planned pick and place by servos: its own dynamics and contacts find none but the grasp."""

import runpy

import numpy as np
import pytest

from rrtik_tests.places import ROOT

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def played():
    pytest.importorskip("mujoco")
    return runpy.run_path(str(ROOT / "examples/mujoco_replay.py"))


def test_the_cup_alone_is_touched_and_comes_to_its_place(played):
    grasp = {frozenset(("cup", f"panda_{side}finger")) for side in ("left", "right")}
    assert played["plan"].proven
    assert played["touching"] == {*grasp, frozenset(("cup", "table"))}
    cup = played["data"].body("cup").xpos
    assert cup == pytest.approx(played["plan"].end.scene.obstacle("cup").pose.translation, abs=0.01)
    assert np.abs(played["data"].qpos[:7] - played["plan"].path.end).max() < 1e-2


def test_the_straight_way_over_the_table_touches_the_wall(played):
    """What the simulation would find if the plan were wrong."""
    import mujoco

    data = mujoco.MjData(played["model"])
    plan = played["plan"]
    over = next(k for k, stage in enumerate(plan.stages) if k > 2 and "MoveTo" in str(stage))
    way = np.linspace(plan.paths[over - 1].start, plan.paths[over + 1].end, 800)
    data.qpos[:9] = np.append(way[0], [0.04, 0.04])
    found = set()
    for q in way:
        data.ctrl = np.append(q, [0.04, 0.04])
        mujoco.mj_step(played["model"], data)
        found |= {played["model"].body(played["model"].geom_bodyid[g]).name for c in data.contact for g in c.geom}
    assert "wall" in found
