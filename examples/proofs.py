"""A path and what proves it, in files; verified by a module that knows neither planners nor kernels."""

import rrtik_ompl as rrtik

problem = rrtik.load_problem("planar3_boxes")
path = rrtik.plan(problem, seed=1).require()
proof = problem.world.prove(path)
print(f"proven: {proof.proven}, {1e3 * proof.clearance:.1f} mm are kept on the whole way")
path.save("path.json")
written = problem.world.certificate(path, proof.clearance)
assert written, "what is not proven has no certificate"
written.save("proof.json")

certificate = rrtik.Certificate.load("proof.json")
fault = problem.world.verify(certificate, rrtik.JointPath.load("path.json").waypoints)
print(fault or "verified")

moved = path.waypoints.copy()
moved[1, 0] += 0.3
print("a waypoint moved:", problem.world.verify(certificate, moved))
print("and by a search:", problem.world.prove(moved).unproven)
