"""Two arms on one base reach for two places at once, and do not touch each other."""

import rrtik_ompl as rrtik

problem = rrtik.load_problem("two_titan4")
plan = rrtik.plan(problem, seed=1)
assert plan.found, plan.reason
print(
    f"{problem.robot.dof} joints, {plan.path.length:.2f} rad, least clearance {1e3 * plan.path.proof.clearance:.1f} mm"
)
