"""Pick a cup up and put it down elsewhere, with two ways to grasp it; one motion with times."""

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl import Alternatives, Attach, Detach, Gripper, MoveTo, Straight, Task

hand = rrtik.load_robot("panda").gripper
robot = rrtik.load_robot("panda", locked=hand.posture("open"))
table = rrtik.Obstacle("table", rrtik.Box(0.7, 1.2, 0.04), [0.55, 0.0, 0.18])
cup = rrtik.Obstacle("cup", rrtik.Box(0.05, 0.05, 0.1), [0.5, 0.25, 0.25])  # it stands on the table
world = rrtik.World(robot, rrtik.Scene([table, cup]))


def grasp(yaw: float) -> list[rrtik.Stage]:
    """From above, the hand turned by an angle."""
    above = rrtik.PoseGoal([0.5, 0.25, 0.39, np.pi, 0.0, yaw])
    return [MoveTo(above), Straight(by=[0, 0, -0.12]), Attach("cup", "panda_hand"), Gripper("close", width=0.05)]


place = rrtik.PoseGoal([0.5, -0.25, 0.39, np.pi, 0.0, 0.0])
stages: list[rrtik.Stage] = [Alternatives([grasp(0.0), grasp(np.pi / 2)]), Straight(by=[0, 0, 0.12])]
stages += [MoveTo(place), Straight(by=[0, 0, -0.12]), Detach("cup"), Gripper("open"), Straight(by=[0, 0, 0.12])]
plan = Task(stages).plan(world, "ready", seed=1)
assert plan.found, plan.reason
print(*plan.notes, sep="\n")

timed = plan.time_parameterize(pause=0.5)
print(f"{len(plan.stages)} stages, grasp {plan.chosen[0] + 1}, {timed.trajectory.duration:.1f} s")
rrtik.view(world, plan, html="task.html")
