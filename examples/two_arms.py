"""Two arms on one base reach for two places at once, and do not touch each other."""

import rrtik_ompl as rrtik

problem = rrtik.load_problem("two_titan4")
path = rrtik.plan(problem, seed=1).require()
proof = problem.world.prove(path)
print(f"{problem.robot.dof} joints, {path.length:.2f} rad, least clearance {1e3 * proof.clearance:.1f} mm")
