"""Many plans: in order, the same however they are spread, as plan() makes each of them."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PlannerError
from rrtik_tests.clusters import cluster

BAD_PLANNERS = """\
import ctypes, numpy as np
from ompl import base as ob
from rrtik_planners import FastRRTConnect

class Moody(FastRRTConnect):
    \"\"\"Answers well, but for queries whose start says what to do.\"\"\"

    def solve_rows(self, starts, *others, **options):
        mood = round(1000 * starts[0, 0])
        if mood == 1:
            ctypes.string_at(0)
        elif mood == 2:
            while True:
                pass
        elif mood == 3:
            kept = []
            while True:
                kept.append(np.ones(1_000_000))
        return super().solve_rows(starts, *others, **options)

    def search(self, starts, *others):
        if round(1000 * starts[0, 0]) == 4:
            raise ValueError("no idea")
        return super().search(starts, *others)

    def solve_each(self, ends, seeds, bounds):
        return [None] * len(seeds)

class Raiser(ob.Planner):
    def __init__(self, si):
        super().__init__(si, "Raiser")

    def solve(self, ptc):
        raise ValueError("no idea")
"""


@pytest.fixture(scope="module")
def boxes():
    return rrtik.load_problem("planar3_boxes")


def same(one, other):
    """Whether two plans have the same path, and what else does not depend on how they were made."""
    paths = (None if each.path is None else each.path.waypoints.tolist() for each in (one, other))
    left, right = paths
    return left == right and (one.found, one.reason, one.planner, one.seed) == (
        other.found,
        other.reason,
        other.planner,
        other.seed,
    )


def ends(boxes):
    """Starts and goals, of which one start is outside the limits."""
    starts = np.stack([boxes.start, boxes.start + 0.01, boxes.start + 100.0, boxes.start - 0.01])
    return starts, [boxes.goal, boxes.goal, boxes.goal, rrtik.JointGoal(boxes.start)]


@pytest.mark.parametrize("planner", [None, "RRTConnect"])  # None: fastrrtconnect first
def test_problems_and_ends_in_their_world_give_the_same_plans_in_threads_and_processes(boxes, planner):
    starts, goals = ends(boxes)
    world = rrtik.plan_many(boxes.world, starts, goals, planner, seconds=60.0, seed=3)
    usable = [0, 1, 3]
    problems = [rrtik.Problem(boxes.world, starts[k], goals[k]) for k in usable]
    assert [each.found for each in world] == [True, True, False, True]
    assert "outside its limits" in world[2].reason

    in_processes = rrtik.plan_many(boxes.world, starts, goals, planner, seconds=60.0, seed=3, processes=2)
    assert all(same(one, other) for one, other in zip(world, in_processes, strict=True))
    assert in_processes[0].statistics["memory_mb"] > 10.0

    alone = [
        rrtik.plan(problem, planner, seconds=60.0, seed=world[k].seed)
        for k, problem in zip(usable, problems, strict=True)
    ]
    assert all(same(one, world[k]) for one, k in zip(alone, usable, strict=True))
    first = rrtik.plan_many(problems[:2], planner, seconds=60.0, seed=3)
    assert all(same(one, other) for one, other in zip(first, world, strict=False))
    of_problems = rrtik.plan_many(problems, planner=planner, seconds=60.0, seed=3, threads=2)
    elsewhere = rrtik.plan_many(iter(problems), planner, seconds=60.0, seed=3, processes=1)
    assert all(same(one, other) for one, other in zip(of_problems, elsewhere, strict=True))
    assert [each.problem for each in of_problems] == [each.problem for each in elsewhere] == problems


def test_names_files_and_problems_stand_side_by_side_and_one_that_is_broken_is_lost_alone(boxes, tmp_path):
    (tmp_path / "broken.yaml").write_text("version: 1\n")
    boxes.save(tmp_path / "boxes.yaml")
    given = ["titan4_prisms", tmp_path / "boxes.yaml", boxes, str(tmp_path / "broken.yaml"), "planar3_boxes"]
    plans, elsewhere = (
        rrtik.plan_many(given, "RRTConnect", seconds=60.0, seed=3, **way) for way in ({"threads": 2}, {"processes": 2})
    )
    assert [each.found for each in plans] == [True, True, True, False, True]
    assert "robot" in plans[3].reason
    assert all(same(one, other) for one, other in zip(plans, elsewhere, strict=True))
    assert same(plans[4], rrtik.plan(boxes, "RRTConnect", seconds=60.0, seed=plans[4].seed))
    with pytest.raises(InputError, match="robot"):
        rrtik.plan_many(given[3:4])


def test_problems_name_their_planners(boxes):
    named = [
        rrtik.Problem(boxes.world, boxes.start, boxes.goal, planner=name)
        for name in ("bicrdt", "RRTConnect", None, "RRTConnect", "nobody")
    ]
    for way in ({"threads": 1}, {"threads": 3}, {"processes": 1}):
        plans = rrtik.plan_many(named, seed=1, seconds=60.0, shorten=False, **way)
        assert [each.planner for each in plans[:4]] == ["bicrdt", "RRTConnect", "fastrrtconnect", "RRTConnect"]
        assert all(
            same(each, rrtik.plan(problem, seed=each.seed, seconds=60.0, shorten=False))
            for each, problem in zip(plans[:4], named, strict=False)
        )
        assert "no planner 'nobody'" in plans[4].reason


@pytest.mark.slow
def test_a_planner_that_crashes_hangs_eats_or_breaks_loses_one_query_alone(boxes, tmp_path, monkeypatch):
    file = tmp_path / "bad_planners.py"
    file.write_text(BAD_PLANNERS)
    monkeypatch.setattr("rrtik_ompl.many.PATIENCE", (1.0, 8.0))
    starts = np.tile(boxes.start, (6, 1))
    starts[:, 0] = [0.0, 0.001, 0.002, 0.003, 0.004, 0.0]
    plans = rrtik.plan_many(
        boxes.world, starts, [boxes.goal] * 6, f"{file}:Moody", seconds=2.0, processes=2, memory_mb=200.0
    )
    assert [each.found for each in plans] == [True, False, False, False, False, True]
    assert plans[1].reason.startswith("crash: SIGSEGV")
    assert plans[2].reason == "hang: killed after 10 s"
    assert plans[2].seconds > 9.0
    assert plans[3].reason.startswith("out of memory: more than 200 MB")
    assert "Moody broke: ValueError: no idea" in plans[4].reason
    in_threads = rrtik.plan_many(boxes.world, starts[[0, 4, 5]], [boxes.goal] * 3, f"{file}:Moody")
    assert [each.found for each in in_threads] == [True, False, True]
    assert in_threads[1].reason == plans[4].reason


def test_a_planner_that_breaks_each_time_is_an_error(boxes, tmp_path):
    (tmp_path / "bad_planners.py").write_text(BAD_PLANNERS)
    for way in ({}, {"processes": 1}):
        with pytest.raises(PlannerError, match="Raiser broke"):
            rrtik.plan_many([boxes, boxes], f"{tmp_path / 'bad_planners.py'}:Raiser", **way)
        with pytest.raises(InputError, match="range cannot be"):
            rrtik.plan_many([boxes], "RRTConnect", parameters={"range": "long"}, **way)


@pytest.mark.parametrize(
    ("planner", "shorten"),
    [(None, True), (None, False), (None, "shortcut")] + [("fastrrtconnect", how) for how in ("auto", False, "ompl")],
)
def test_paths_are_finished_as_plan_finishes_them(planner, shorten):
    robot = rrtik.load_robot("ur5")
    world = rrtik.World(
        robot, rrtik.Scene([rrtik.Obstacle("post", rrtik.Box([0.2, 0.2, 0.9]), rrtik.pose([0.4, 0, 0.3]))])
    )
    rows = np.random.default_rng(5).uniform(-2.0, 2.0, (60, 6))
    rows = rows[world.valid_batch(rows)]
    starts, goals = rows[:8], rows[8:16]
    plans = rrtik.plan_many(world, starts, goals, planner, seconds=60.0, seed=4, shorten=shorten, threads=2)
    assert sum(each.found for each in plans) > 4
    for start, goal, each in zip(starts, goals, plans, strict=True):
        problem = rrtik.Problem(world, start, goal)
        alone = rrtik.plan(problem, planner, seconds=60.0, seed=each.seed, shorten=shorten)
        assert same(each, alone)
        assert each.statistics.keys() == alone.statistics.keys()
        assert (each.proven, each.unshortened is None) == (alone.proven, alone.unshortened is None)


def test_a_seed_that_is_drawn_is_named(boxes):
    (drawn,) = rrtik.plan_many([boxes], "fastrrtconnect", seconds=60.0, seed=None)
    assert same(drawn, rrtik.plan(boxes, "fastrrtconnect", seconds=60.0, seed=drawn.seed))


def test_nothing_is_planned_for_nothing(boxes):
    assert rrtik.plan_many([]) == []
    assert rrtik.plan_many([], processes=1) == []
    assert rrtik.plan_many(boxes.world, np.zeros((0, 3)), np.zeros((0, 3))) == []


START, GOAL = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        ((["planar3_boxes", "planar3_z"],), {}, r"problems\[1\]: no problem 'planar3_z'"),
        ((["none.yaml"],), {}, r"problems\[0\]: there is no file none.yaml"),
        (
            ("planar3_a",),
            {},
            r"expected a list of problems, names or files, got 'planar3_a'; for one query use plan\(\)",
        ),
        ((["planar3_a", 3],), {}, r"problems\[1\] must be a Problem, a name or a file, got int"),
        (([(START, GOAL)],), {}, r"problems\[0\] .* got tuple; .* plan_many\(world, starts, goals\)"),
        ((None,), {}, "expected a list of problems"),
        (("world", [(START, GOAL)]), {}, r"no goals; .* plan_many\(world, starts, goals\)"),
        (("world",), {}, "no starts"),
        (("world", [START[:2]], [GOAL]), {}, r"starts: expected .*\(any, 3\), got shape \(1, 2\)"),
        (("world", [START], [GOAL, GOAL]), {}, "as many starts as goals are needed, got 1 and 2"),
        (("world", [START], [GOAL], 3), {}, "planner must be of type"),
        ((["planar3_a"], [START], [GOAL]), {}, "goals belong to one world"),
        ((["planar3_a"], [START]), {}, "after problems comes the planner, a name or a class, got list"),
        ((["planar3_a"], "bicrtd"), {}, "no planner 'bicrtd'"),
        ((["planar3_a"], "bicrdt"), {"parameters": {"rnage": 1}}, "no parameter of planner bicrdt 'rnage'"),
        ((["planar3_a"],), {"parameters": {"range": 1}}, "planner 'auto' takes no options, got range"),
        ((["planar3_a"],), {"shorten": "axle"}, "no shortening method 'axle'"),
        ((["planar3_a"],), {"proof": "perhaps"}, "no proof 'perhaps'"),
        ((["planar3_a"],), {"seconds": 0}, "seconds: must be greater than 0"),
        ((["planar3_a"],), {"seed": -1}, "seed must be a whole number"),
        ((["planar3_a"],), {"threads": 0}, "threads must be a whole number of at least 1, got 0"),
        ((["planar3_a"],), {"processes": 1.5}, "processes must be a whole number of at least 1, got 1.5"),
        ((["planar3_a"],), {"threads": 2, "processes": 2}, "one of threads, .* got threads=2 and processes=2"),
        ((["planar3_a"],), {"memory_mb": 100}, "memory_mb: threads share the memory"),
        ((["planar3_a"],), {"memory_mb": 0, "processes": 1}, "memory_mb: must be greater than 0"),
        ((["planar3_a"],), {"scheduler": 3}, "scheduler must be of type str"),
        (
            (["planar3_a"],),
            {"parameters": {"f": lambda: 0}, "processes": 1},
            "query 0 cannot be sent to another process",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(boxes, given, options, words):
    given = [boxes.world if isinstance(each, str) and each == "world" else each for each in given]
    with pytest.raises(InputError, match=words) as refused:
        rrtik.plan_many(*given, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_workers_of_a_cluster_find_the_paths_of_threads(boxes, tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    starts, goals = ends(boxes)
    with cluster(tmp_path) as (address, _):
        in_world = rrtik.plan_many(
            boxes.world, starts, goals, "fastrrtconnect", seconds=60.0, seed=3, scheduler=address
        )
        of_problems = rrtik.plan_many([boxes, "planar3_boxes"], "RRTConnect", seconds=60.0, scheduler=address)
    here = rrtik.plan_many(boxes.world, starts, goals, "fastrrtconnect", seconds=60.0, seed=3)
    here += rrtik.plan_many([boxes, "planar3_boxes"], "RRTConnect", seconds=60.0)
    assert all(same(one, other) for one, other in zip(in_world + of_problems, here, strict=True))
    with pytest.raises(InputError, match="scheduler nowhere: no Dask scheduler answers"):
        rrtik.plan_many([boxes], scheduler="nowhere")
