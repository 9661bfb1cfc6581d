"""A plan in viser, a viewer of others that a server draws in the browser, with pinocchio's arm: pip install viser."""

# pyright: reportMissingImports=false
import time

import numpy as np
import pinocchio as pin
import viser
from pinocchio.visualize import ViserVisualizer

import rrtik_ompl as rrtik

problem = rrtik.load_problem("panda_shelf")
robot = problem.robot
path = rrtik.plan(problem, seed=1).require()
motion = rrtik.time_parameterize(path, robot, blend=0.2, world=problem.world)
print(f"{motion.duration:.2f} s, proven free: {motion.prove(problem.world).proven}")

server = viser.ViserServer()
server.initial_camera.position = (1.3, -1.9, 1.4)
arm = ViserVisualizer(robot.model, robot.collision, robot.visual)
arm.initViewer(viewer=server, loadModel=True)
for each in problem.world.scene.obstacles:
    solid = server.scene.add_mesh_simple(f"/scene/{each.name}", *each.shape.surface(), color=(170, 160, 145))
    solid.position = each.pose.translation
    solid.wxyz = np.roll(pin.Quaternion(each.pose.rotation).coeffs(), 1)  # pinocchio has w last
tips = robot.fk_batch(motion.positions)[:, :3, 3]
server.scene.add_spline_catmull_rom("/trail", tips, thickness=0.006, color=(31, 111, 235))
clock = server.gui.add_slider("time [s]", min=0.0, max=motion.duration, step=0.001, initial_value=0.0)


def show(_: object) -> None:
    """Draw the arm as it is at the time of the slider."""
    arm.display(robot.pinocchio_configuration(motion(clock.value).positions[None])[0])


clock.on_update(show)
while __name__ == "__main__":  # plays again and again, until Ctrl-C
    clock.value = time.monotonic() % motion.duration
    time.sleep(1 / 30)
