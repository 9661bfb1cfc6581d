"""One version's side of `bench/whole_calls/report.py`: measures what it is asked, a line of JSON for each question.

Run as a script with the version to measure on ``PYTHONPATH``; it uses nothing of this folder.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from ompl import util as ou

import rrtik_ompl
from rrtik_ompl import (
    JointGoal,
    JointPath,
    Obstacle,
    Problem,
    ProblemError,
    Scene,
    World,
    load_problem,
    load_robot,
    plan,
)
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder
from rrtik_ompl.planning import second_check
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.world.proof import Prover

ARMS = {"panda": "panda_arm", "ur5": "manipulator"}  # robot and group of the MotionBenchMaker sets
PER_RADIAN = 32.0  # checks, as VAMP [13] counts
REPEATS, SEEDS = 5, (1, 2)
PLANNER = "fastrrtconnect"
SECONDS, QUERIES = 5.0, 300


@cache
def _robot(folder: Path, arm: str, balls: bool) -> Any:
    name = f"{arm}_spherized.urdf" if balls else f"{arm}.urdf"
    return load_robot(folder / name, srdf=folder / f"{arm}.srdf", group=ARMS[arm])


def problem_of(file: str, *, balls: bool) -> Problem | None:
    """A problem of a set on exact meshes; or on the balls and obstacles of VAMP, None if an end collides there."""
    scene = Path(file)
    folder, arm = scene.parent.parent.parent, scene.parent.name.rsplit("_", 1)[1]
    exact = load_motion_bench_maker(scene, robot=_robot(folder, arm, False))
    if not balls:
        return exact
    boxes = scene.parent.name.startswith("box_")
    obstacles = tuple(Obstacle(o.name, _vamp_shape(o.shape, boxes), o.pose) for o in exact.world.scene.obstacles)
    try:
        world = World(_robot(folder, arm, True), Scene(obstacles), accuracy="conservative")
        return Problem(world, exact.start, exact.goal)
    except ProblemError:
        return None


def _vamp_shape(shape: Any, boxes: bool) -> Any:
    """VAMP checks capsules for cylinders, except in the family ``box``, where it takes the boxes around them."""
    if not isinstance(shape, Cylinder):
        return shape
    return Box((2.0 * shape.radius, 2.0 * shape.radius, shape.length)) if boxes else Capsule(shape.radius, shape.length)


def spent(call: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of a call [s], and what it returned."""
    begin = time.process_time()
    result = call()
    return time.process_time() - begin, result


def search_on_balls(file: str) -> dict[str, Any]:
    """A bare search for each seed, the best of a few calls [us]; motions checked, and how many paths coal certifies."""
    problem = problem_of(file, balls=True)
    if problem is None:
        return {}
    world, chain = problem.world, problem.robot.chain
    assert world.fast is not None
    rule: dict[str, Any] = {"weights": np.zeros(problem.robot.dof), "resolution": world.motion_resolution}
    motions = FastMotions(world.fast, chain.gain, chain.offset, steps_per_unit=PER_RADIAN, **rule)
    search = ConnectSearch(motions, *problem.robot.finite_range())
    end = time.perf_counter() + SECONDS
    best, checked, certified = [], [], 0
    for seed in SEEDS:
        call = partial(_search, search, problem, seed, end)
        runs = [spent(call) for _ in range(REPEATS)]
        best.append(1e6 * min(taken for taken, _ in runs))
        checked.append(search.statistics()["motions"])
        rows = runs[0][1]
        certified += rows is not None and bool(world.certify(_dense(rows)).all())
    return {"us": best, "motions": checked, "certified": certified}


def _search(search: ConnectSearch, problem: Problem, seed: int, end: float) -> Any:
    assert isinstance(problem.goal, JointGoal)
    return search.solve(problem.start[None], problem.goal.q[None], seed, stop=lambda: time.perf_counter() > end)


def _dense(rows: Any) -> Any:
    """A path in steps as fine as the search's."""
    shares = [np.linspace(0.0, 1.0, 2 + int(PER_RADIAN * np.linalg.norm(b - a)))[:, None] for a, b in pairwise(rows)]
    return np.vstack([a + s * (b - a) for s, a, b in zip(shares, rows, rows[1:], strict=False)] + [rows[-1:]])


def plan_on_meshes(file: str) -> dict[str, Any]:
    """`plan()` with everything that it does by default, see :func:`_planned`."""
    problem = problem_of(file, balls=False)
    assert problem is not None
    return _planned(problem, SEEDS)


def plan_shipped(name: str) -> dict[str, Any]:
    """The same of a shipped problem, over more seeds."""
    return _planned(load_problem(name), range(20))


def _planned(problem: Problem, seeds: Iterable[int]) -> dict[str, Any]:
    """Processor time of `plan()` [ms], the best of two calls; what of it is neither search nor proof; plans found.

    The first plan in a world also makes what the world keeps, so it is not counted.
    """
    call = partial(plan, problem, PLANNER, seconds=SECONDS)
    call(seed=0)
    whole, around, found = [], [], 0
    for seed in seeds:
        runs = [spent(partial(call, seed=seed)) for _ in range(2)]
        whole.append(1e3 * min(taken for taken, _ in runs))
        with _clocked() as inside:
            again, _ = spent(partial(call, seed=seed))
        around.append(1e3 * (again - sum(inside)))
        found += runs[0][1].found
    return {"ms": whole, "around": around, "found": found}


@contextmanager
def _clocked() -> Iterator[list[float]]:
    """Collects the processor time [s] of searches in kernels, and of proofs and second checks."""
    inside: list[float] = []
    within = [False]

    def clocked(usual: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            if within[0]:
                return usual(*arguments, **options)
            within[0] = True
            try:
                taken, result = spent(partial(usual, *arguments, **options))
            finally:
                within[0] = False
            inside.append(taken)
            return result

        return call

    with ExitStack() as patches:
        for owner, names in {
            ConnectSearch: ("solve",),
            Prover: ("route", "proven"),
            World: ("certify",),
            JointPath: ("violations", "proved"),
            second_check: ("with_detours",),
        }.items():
            for name in names:
                patches.enter_context(patch.object(owner, name, clocked(getattr(owner, name))))
        yield inside


def plan_many(file: str) -> dict[str, Any]:
    """Plans between random free configurations in one world: processor time of each [ms], and of a `Problem` [ms]."""
    problem = problem_of(file, balls=False)
    assert problem is not None
    world, rng = problem.world, np.random.default_rng(1)
    rows = rng.uniform(*world.robot.finite_range(), (3 * QUERIES, world.robot.dof))
    free = rows[world.valid_batch(rows)]
    free = free[world.certify(free)][: QUERIES + 1]
    made = [spent(partial(Problem, world, a, b)) for a, b in pairwise(free)]
    runs = [spent(partial(plan, each, PLANNER, seed=k, seconds=SECONDS)) for k, (_, each) in enumerate(made)]
    return {
        "ms": [1e3 * taken for taken, _ in runs],
        "problem": [1e3 * taken for taken, _ in made],
        "found": sum(found.found for _, found in runs),
    }


ROWS = {each.__name__: each for each in (search_on_balls, plan_on_meshes, plan_shipped, plan_many)}


def answer_questions() -> None:
    """Answer questions until there are no more; what libraries print goes to the errors."""
    warnings.simplefilter("ignore")
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    print(json.dumps({"package": rrtik_ompl.__file__}), file=answers, flush=True)
    for line in sys.stdin:
        row, subject = json.loads(line)
        print(json.dumps(ROWS[row](subject)), file=answers, flush=True)


if __name__ == "__main__":
    answer_questions()
