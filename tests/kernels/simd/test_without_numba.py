"""Without numba numpy answers after one warning; with it there is none."""

import os
import subprocess
import sys
import warnings

import pytest

from rrtik_tests.random_cases import Case

pytestmark = pytest.mark.kernels


def run(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **environment}, check=False
    )


SMALL = """
import warnings; warnings.simplefilter("always")
import coal, numpy as np, pinocchio as pin
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import FastWorld
bodies = [Body("b", j, pin.SE3.Identity(), coal.Sphere(0.1), "link") for j in (0, 6)]
spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
chain = load_robot("titan4").chain
worlds = [FastWorld(chain, bodies, [(0, 1)], outer=spheres, inner=spheres) for _ in range(2)]
print([w.classify(np.zeros((3, 6))).tolist() for w in worlds])
"""
ANSWER = "[[0, 0, 0], [0, 0, 0]]"


def test_without_numba_numpy_answers_after_one_warning(tmp_path):
    done = run("import sys; sys.modules['numba'] = None\n" + SMALL, RRTIK_CACHE=str(tmp_path))
    assert done.stdout.strip() == ANSWER, done.stderr
    assert done.stderr.count("RuntimeWarning") == 1
    assert "install numba" in done.stderr


def test_the_compiled_world_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Case("titan4", 1)
