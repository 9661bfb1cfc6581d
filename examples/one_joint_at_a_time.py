"""A path that a person can drive: one joint at a time, as few moves as possible, and proof that fewer do not do."""

import numpy as np

import rrtik_ompl as rrtik

problem = rrtik.load_problem("titan4_sdu")
own = rrtik.plan(problem, "bicrdt", shorten=False).require()
quick = rrtik.plan(problem, "bicrdt").require()
print(f"bicrdt: {own.transitions} moves; shortened: {quick.transitions}")

best = rrtik.plan(problem, "fewest-moves", seed=1)
print(f"fewest-moves: {best.require().transitions}, and no path has fewer than {best.statistics['lower_bound']}")
for move in best.require().moves():
    print(f"  {move.joint:>16} from {np.degrees(move.start):7.1f} to {np.degrees(move.end):7.1f} degrees")

smooth = rrtik.plan(problem, "RRTConnect", seed=1).require()  # any path can be had in single-joint moves
print(f"RRTConnect, then one_joint_moves: {rrtik.one_joint_moves(smooth, problem).transitions} moves")
