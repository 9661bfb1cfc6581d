"""Some planners of ours and of OMPL on one problem: time, length, moves."""

import time

import rrtik_ompl as rrtik

problem = rrtik.load_problem("titan4_prisms")
print(f"{'planner':>16} {'ms':>8} {'rad':>6} {'moves':>6}")
for name in ("auto", "fastrrtconnect", "bicrdt", "RRTConnect", "BKPIECE1", "KPIECE1"):
    begin = time.process_time()
    plan = rrtik.plan(problem, name, seconds=2.0, seed=1)
    spent = 1e3 * (time.process_time() - begin)
    result = f"{plan.path.length:6.2f} {plan.path.transitions:6}" if plan.path else plan.reason
    print(f"{name:>16} {spent:8.1f} {result}")
