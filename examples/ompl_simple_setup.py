"""Our world in OMPL's own classes: a SimpleSetup with one of OMPL's planners and one of ours."""

from ompl import geometric as og

import rrtik_ompl as rrtik
from rrtik_planners import FastRRTConnect

problem = rrtik.load_problem("titan4_prisms")
for kind in (og.RRTConnect, FastRRTConnect):
    setup = rrtik.ompl.simple_setup(problem)
    setup.setPlanner(kind(setup.getSpaceInformation()))
    solved = setup.solve(2.0)
    path = setup.getSolutionPath()
    print(f"{kind.__name__}: {solved.asString()}, {path.getStateCount()} states, valid: {path.check()}")
