"""Where a suite's problems come from: folders of pairs, scaling, crowds."""

import json

import numpy as np

from rrtik_ompl import load_robot, plan
from rrtik_ompl.benchmark.scaling import crowded_arm, planar_chain
from rrtik_ompl.benchmark.sources import build
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_planners.suites import FOLDER


def test_a_folder_of_motion_bench_maker_pairs_is_a_list_of_problems(tmp_path):
    for name in ("box/scene1", "box/request1", "box/scene2", "box/request2", "cage/scene1", "cage/request1"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.yaml").write_text("robot_model_name: panda\n")
    sources = load_suite(FOLDER / "mbm_panda.yaml", folder=tmp_path).sources
    top = tmp_path.name
    assert [source.name for source in sources] == [f"{top}/box/scene1", f"{top}/box/scene2", f"{top}/cage/scene1"]
    assert [source.group for source in sources] == [f"{top}/box", f"{top}/box", f"{top}/cage"]


def test_scaling_problems_have_what_was_asked_for_and_are_not_trivial():
    for problem, dof, obstacles in (
        (planar_chain(12), 12, 4),
        (crowded_arm(load_robot("ur5"), 1), 6, 1),
        (crowded_arm(load_robot("ur5"), 12), 6, 12),
    ):
        assert problem.robot.dof == dof
        assert len(problem.world.scene.obstacles) == obstacles
        assert not problem.world.motion_valid(problem.start, problem.goal.q)
        assert plan(problem, "fastrrtconnect", seconds=20.0, seed=1).found


def test_start_and_goal_of_a_crowd_do_not_depend_on_its_number():
    few, many = (crowded_arm(load_robot("titan4"), count, seed=3) for count in (1, 20))
    assert np.array_equal(few.start, many.start)
    assert np.array_equal(few.goal.q, many.goal.q)


def test_a_source_survives_json(suite):
    from rrtik_ompl.benchmark.sources import from_plain

    source = load_suite(suite).sources[1]
    again = from_plain(json.loads(json.dumps(source.plain())))
    assert again == source
    assert build(again).robot.dof == 4
