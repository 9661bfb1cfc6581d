"""What a planner of ours tells: its graph, its options, how near it came, how its path got shorter."""

from __future__ import annotations

import sqlite3
import xml.etree.ElementTree as ET
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ompl import geometric as og
from ompl import tools as ot

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.ompl_bridge.contract import outside_bar, outside_wall, small_problem, solution_rows
from rrtik_planners import CRDT, IKURT, MBRRT, BiCRDT, CBiRRT, DRRTCon, FastRRTConnect, FewestMoves

GROWING = (BiCRDT, CBiRRT, CRDT, FastRRTConnect, IKURT, MBRRT)
TWO_TREES = (BiCRDT, CBiRRT, DRRTCon, FastRRTConnect, MBRRT)
BLOCKED = (-0.4, 0.0, 0.0)  # a goal behind a wall that nothing passes

pytestmark = pytest.mark.usefixtures("quiet_ompl")


def solved(planner: Any, valid: Any = outside_bar, seconds: float = 5.0, **options: Any) -> tuple[Any, Any, str]:
    setup = small_problem(valid)
    made = planner(setup.getSpaceInformation(), seed=3, **options)
    setup.setPlanner(made)
    return setup, made, str(setup.solve(seconds))


@pytest.mark.parametrize("planner", GROWING, ids=lambda p: p.__name__)
def test_every_edge_of_a_graph_is_free_and_its_path_lies_in_it(planner: Any) -> None:
    setup, made, _ = solved(planner)
    graph, si = made.graph(), setup.getSpaceInformation()
    a, b = si.allocState(), si.allocState()
    for first, second in graph.edges.tolist():
        a[0:3], b[0:3] = graph.vertices[first].tolist(), graph.vertices[second].tolist()
        assert si.checkMotion(a, b)
    assert graph.vertices[graph.starts].tolist() == [[-1.0, -1.0, -1.0]]
    assert np.allclose(graph.costs, np.linalg.norm(np.diff(graph.vertices[graph.edges], axis=1)[:, 0], axis=1))
    assert len(graph.edges) >= len(graph.vertices) - len(graph.starts) - len(graph.goals) > 0 or planner is CBiRRT


@pytest.mark.parametrize("planner", [DRRTCon, FewestMoves], ids=lambda p: p.__name__)
def test_a_planner_without_a_tree_shows_its_path(planner: Any) -> None:
    setup, made, _ = solved(planner)
    graph, rows = made.graph(), solution_rows(setup)
    assert np.array_equal(graph.vertices, rows)
    assert len(graph.edges) == len(rows) - 1


def test_a_graph_in_kernels_has_certain_edges_only() -> None:
    problem = rrtik.load_problem("titan4_prisms")
    setup = rrtik.ompl.simple_setup(problem)
    made = FastRRTConnect(setup.getSpaceInformation(), world=problem.world, seed=2)
    setup.setPlanner(made)
    assert str(setup.solve(5.0)) == "Exact solution"
    graph = made.graph()
    assert len(graph.edges) > 0
    ends = graph.vertices[graph.edges]
    assert problem.world.motion_valid_batch(ends[:, 0], ends[:, 1]).all()


def test_graphs_are_written_and_become_planner_data(tmp_path: Path) -> None:
    setup, made, _ = solved(BiCRDT)
    graph = made.graph()
    graph.save(tmp_path / "graph.xml")
    space = {"g": "http://graphml.graphdrawing.org/xmlns"}
    root = ET.parse(tmp_path / "graph.xml").getroot()
    nodes, edges = root.findall(".//g:node", space), root.findall(".//g:edge", space)
    coords = [[float(x) for x in node.find("g:data", space).text.split(",")] for node in nodes]
    assert np.array_equal(coords, graph.vertices)
    assert len(edges) == len(graph.edges)
    data = graph.planner_data(setup.getSpaceInformation())
    assert (data.numVertices(), data.numEdges()) == (len(graph.vertices), len(graph.edges))
    assert (data.numStartVertices(), data.numGoalVertices()) == (1, 1)


def test_there_is_no_graph_before_a_solve_and_after_clear() -> None:
    setup, made, _ = solved(BiCRDT)
    setup.clear()
    with pytest.raises(PlannerError, match="there is no graph"):
        made.graph()


@pytest.mark.parametrize("planner", TWO_TREES, ids=lambda p: p.__name__)
def test_two_trees_that_do_not_meet_give_the_nearest_approach(planner: Any) -> None:
    setup, made, status = solved(planner, outside_wall, 0.3)
    assert status == "Approximate solution"
    path, rows = setup.getSolutionPath(), solution_rows(setup)
    assert path.check()
    assert rows[0].tolist() == [-1.0, -1.0, -1.0]
    away = setup.getProblemDefinition().getSolutionDifference()
    assert away == pytest.approx(np.linalg.norm(rows[-1] - 1.0))
    graph = made.graph()
    assert away <= np.linalg.norm([2.0, 2.0, 2.0])
    assert graph.vertices[:, 0].max() > 0.5  # the tree of the goal is there too


def test_options_are_set_by_texts_and_refused_as_by_the_constructor() -> None:
    setup = small_problem()
    made = FastRRTConnect(setup.getSpaceInformation(), seed=3, domain=0.5)
    made.set("range", "0.3")
    assert made.parameters() == {"range": 0.3, "domain": 0.5, "max_iterations": None, "bound": None}
    same = FastRRTConnect(setup.getSpaceInformation(), seed=3, domain=0.5, range=0.3)
    rows = []
    for each in (made, same):
        setup.clear()
        setup.setPlanner(each)
        assert setup.solve(5.0)
        rows.append(solution_rows(setup))
    assert np.array_equal(*rows)
    for value in ("-1", "wide", "nan"):
        with pytest.raises(InputError, match="range"):
            made.set("range", value)
    with pytest.raises(UnknownNameError, match="rnage"):
        made.set("rnage", "0.3")
    assert made.parameters()["range"] == 0.3
    joints = BiCRDT(setup.getSpaceInformation(), seed=1)
    joints.set("frozen_joints", "[2]")
    assert joints.parameters()["frozen_joints"] == [2]
    assert joints.options.staying


def test_notes_are_taken_of_a_benchmark_of_ompl_only() -> None:
    for wrong in ("log.txt", None, [[1, 2]]):
        with pytest.raises(InputError, match=r"benchmark.*ompl\.tools\.Benchmark"):
            rrtik.ompl.BenchmarkNotes(wrong)


def test_the_log_of_a_benchmark_has_options_graphs_and_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # OMPL's Benchmark writes a console file where it runs
    setup = small_problem()
    si = setup.getSpaceInformation()
    benchmark = ot.Benchmark(setup, "notes")
    for planner in (FastRRTConnect(si, seed=1, range=0.3), og.RRTConnect(si), BiCRDT(si, seed=2)):
        benchmark.addPlanner(planner)
    notes = rrtik.ompl.BenchmarkNotes(benchmark)
    benchmark.benchmark(ot.Request(2.0, 4096.0, 2, 0.05, False, False, False))
    notes.write()
    log = tmp_path / "notes.log"
    benchmark.saveResultsToFile(str(log))
    ot.readBenchmarkLog(str(tmp_path / "notes.db"), [str(log)], False)
    with closing(sqlite3.connect(tmp_path / "notes.db")) as base:
        settings = dict(base.execute("SELECT name, settings FROM plannerConfigs").fetchall())
        assert "range = 0.3" in settings["geometric_FastRRTConnect"]
        states = base.execute("SELECT graph_states FROM runs").fetchall()
        assert all(count > 1 for (count,) in states)
        rows = base.execute("SELECT runid, time, best_cost FROM progress").fetchall()
    assert {run for run, _, _ in rows} == {1, 2, 5, 6}  # of OMPL's RRTConnect, runs 3 and 4, there is none
    assert all(0.0 <= at <= 2.0 for _, at, _ in rows), rows
    for run in (1, 2, 5, 6):  # many moments, each once: of few, or of steps, Planner Arena can draw no curve
        times = [at for of, at, _ in rows if of == run]
        assert len(set(times)) == len(times) > 50
        assert max(times) == 2.0
    assert all(cost >= np.sqrt(12.0) - 1e-6 for _, _, cost in rows), rows
