"""Results that objects keep are made once and let go with them; a robot that nobody holds is freed."""

import ast
import gc
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.kept import MOST_KEPT, Keeper, kept_with


class Thing(Keeper):
    pass


def test_threads_that_want_the_same_result_make_it_once():
    made = []
    barrier = threading.Barrier(4)

    @kept_with
    def slow(thing, number):
        made.append(number)
        time.sleep(0.05)
        return object()

    def ask(_):
        barrier.wait()
        return slow(thing, 1)

    thing = Thing()
    with ThreadPoolExecutor(4) as pool:
        results = set(pool.map(ask, range(4)))
    assert len(results) == len(made) == 1
    assert slow(thing, 2) is slow(thing, 2)
    assert slow(thing, 2) is not slow(thing, number=2)


def test_a_result_that_could_not_be_made_is_made_the_next_time_and_the_oldest_go():
    tries = []

    @kept_with
    def fails_first(thing, number):
        tries.append(number)
        if len(tries) == 1:
            raise ZeroDivisionError
        return number

    thing = Thing()
    with pytest.raises(ZeroDivisionError):
        fails_first(thing, 0)
    assert [fails_first(thing, number) for number in range(MOST_KEPT + 9)] == list(range(MOST_KEPT + 9))
    assert len(thing.kept_results) == MOST_KEPT
    assert fails_first("no keeper", 3) == 3


def test_a_robot_that_is_let_go_is_freed_with_its_worlds_and_tables():
    problem = rrtik.load_problem("planar3_boxes")
    robot = replace(problem.robot, name="another")
    assert not hasattr(robot, "kept_results")
    world = rrtik.World(robot, problem.world.scene)
    path = rrtik.plan(rrtik.Problem(world, problem.start, problem.goal)).require()
    assert rrtik.solve_ik(robot, robot.fk(path.end)).found
    rrtik.time_parameterize(path, robot)
    assert robot.kept_results

    held = [weakref.ref(each) for each in (robot, world)]
    del robot, world, path
    for _ in range(2):  # the first one frees what OMPL's objects have held
        gc.collect()
    assert [each() for each in held] == [None, None]


def test_no_cache_of_a_module_holds_robots():
    root = Path(rrtik.__file__).parent
    held = []
    for file in root.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if "cache" not in text or "Robot" not in text:
            continue
        for each in ast.walk(ast.parse(text)):
            if not isinstance(each, ast.FunctionDef) or not any("cache" in ast.unparse(d) for d in each.decorator_list):
                continue
            if any(a.annotation is not None and "Robot" in ast.unparse(a.annotation) for a in each.args.args):
                held.append(f"{file.relative_to(root)}: {each.name}")
    assert held == ["description/robot_pickle.py: _bytes_of"]  # of two robots
