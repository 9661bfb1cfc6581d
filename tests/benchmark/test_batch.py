"""Batches of queries come back in order, as plan() answers each of them."""

import pytest

from rrtik_ompl import load_problem, plan, plan_batch
from rrtik_ompl.base.errors import InputError


def test_a_batch_of_queries_comes_in_order_and_finds_what_plan_finds(tmp_path):
    problem = load_problem("planar3_a")
    (tmp_path / "planar3_a.yaml").write_text("version: 1\n")  # of the same name, and no problem
    queries = ["titan4_prisms", "planar3_a", tmp_path / "planar3_a.yaml"]
    records = plan_batch(queries, "RRTConnect", seconds=20.0, seed=3, parameters={"range": 0.5}, jobs=2)
    assert [record["problem"] for record in records] == ["titan4_prisms", "planar3_a", "planar3_a"]
    assert [record["status"] for record in records] == ["solved", "solved", "error"]
    assert "robot" in records[2]["reason"]
    alone = plan(problem, "RRTConnect", seconds=20.0, seed=records[1]["seed"], parameters={"range": 0.5}, shorten=False)
    assert records[1]["waypoints"] == alone.path.waypoints.tolist()


def test_planners_of_ours_work_in_threads_and_find_the_same_however_many(monkeypatch):
    def no_process(*_):
        raise AssertionError("a process was started")

    monkeypatch.setattr("rrtik_ompl.benchmark.guard.Guard.run", no_process)
    queries = ["planar3_boxes", "titan4_prisms", "planar3_boxes"]
    one, three = (plan_batch(queries, "fastrrtconnect", seed=2, jobs=jobs) for jobs in (1, 3))
    assert [record["status"] for record in one] == ["solved"] * 3
    assert [record["waypoints"] for record in one] == [record["waypoints"] for record in three]
    with pytest.raises(AssertionError, match="a process"):
        plan_batch(queries[:1], "RRTConnect", seed=2)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"problems": ["planar3_z"]}, "no problem 'planar3_z'"),
        ({"problems": "planar3_a"}, "must be a list"),
        ({"problems": ["planar3_a", 3]}, r"problems\[1\] must be of type str or PathLike, got int; .* Problem.save"),
        ({"planner": "bicrtd"}, "no planner 'bicrtd'"),
        ({"planner": "bicrdt", "parameters": {"rnage": 1}}, "no parameter of planner bicrdt 'rnage'"),
        ({"parameters": {"range": 1}}, "planner 'auto' takes no options, got range"),
        ({"shorten": "axle"}, "no shortening method 'axle'"),
        ({"seconds": 0}, "seconds"),
        ({"jobs": 0}, "jobs"),
    ],
)
def test_a_batch_refuses_what_makes_no_sense(given, words):
    with pytest.raises(InputError, match=words):
        plan_batch(**{"problems": ["planar3_a"], **given})
