"""Without OMPL its planners say why they are not there; everything else works, and works alike."""

import subprocess
import sys

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.ompl_bridge import stand_in
from rrtik_ompl.ompl_bridge.planner_traits import BOUND, ompl_planners

PROGRAM = """
import sys
sys.modules["ompl"] = None  # is not found
import rrtik_ompl as rrtik

for name, planner in (("panda_shelf", "auto"), ("titan4_sdu", "bicrdt")):
    plan = rrtik.plan(rrtik.load_problem(name), planner, seed=1)
    print(name, plan.proven, f"{plan.require().length:.9g}")
problem = rrtik.load_problem(name)
for call in (
    lambda: rrtik.plan(problem, "RRTConnect"),
    lambda: rrtik.plan(problem, "geometric::ESTkConfigDefault"),
    lambda: rrtik.ompl.simple_setup(problem),
    lambda: rrtik.ompl.check_planner(rrtik.ompl.SafePlanner),
    lambda: rrtik.ompl.objectives,
    lambda: rrtik.shorten(plan.path, problem, method="ompl"),
):
    try:
        print("nothing", call())
    except rrtik.RrtikError as error:
        print("said:", error)
print("RRTConnect" in rrtik.list_planners(), [name for name in sys.modules if name.startswith("ompl.")])
"""


@pytest.mark.kernels
def test_what_needs_no_ompl_is_the_same_without_it_and_the_rest_is_told_in_a_line():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    for line, (name, planner) in zip(lines, (("panda_shelf", "auto"), ("titan4_sdu", "bicrdt")), strict=False):
        path = rrtik.plan(rrtik.load_problem(name), planner, seed=1).require()
        assert line == f"{name} True {path.length:.9g}"
    said = [line for line in lines if line.startswith("said:")]
    assert len(said) == 6
    assert all("OMPL is not installed" in line and "pip install ompl" in line for line in said)
    assert lines[-1] == "False []"


def test_what_stands_in_for_ompl_has_its_names_and_words():
    ob = pytest.importorskip("ompl.base", reason="no OMPL")
    assert {*BOUND.split()} == {*ompl_planners()}
    for status in stand_in.PlannerStatus:
        assert str(ob.PlannerStatus(getattr(ob.PlannerStatus, status.name))) == str(status)
    for name in ("Planner", "RealVectorBounds", "RealVectorStateSpace", "SpaceInformation"):
        ours, theirs = getattr(stand_in, name), getattr(ob, name)
        assert [each for each in vars(ours) if not each.startswith("_") and not hasattr(theirs, each)] == []
