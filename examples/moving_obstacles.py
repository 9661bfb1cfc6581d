"""Obstacles move while the arm does: the path is checked at every tick, cut and mended."""

import rrtik_ompl as rrtik

scenario = rrtik.replanning.Scenario.load("replan_walls")
run = scenario.run(record="run.json", seed=1)
print(f"{run.problem}: {len(run.ticks)} ticks, {run.outcome} {run.reason}")
rrtik.view(scenario.problem, run=run, html="run.html")
