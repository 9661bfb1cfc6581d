"""Motion planning for robot arms: a robot and a scene, a problem, a plan, a path that has been checked."""

from rrtik_ompl.catalog import list_problems, list_robots, load_robot
from rrtik_ompl.errors import InputError, PlannerError, ProblemError, RrtikError, UnknownNameError
from rrtik_ompl.goal import GoalRegion, JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.path import JointPath, load_path
from rrtik_ompl.plan import Plan, list_planners, plan
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_file import load_problem, save_problem
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.scene_file import load_scene, save_scene
from rrtik_ompl.shorten import shorten
from rrtik_ompl.viewer import view
from rrtik_ompl.world import World

__version__ = "0.1.0"

__all__ = [
    "AttachedObject",
    "GoalRegion",
    "InputError",
    "JointGoal",
    "JointPath",
    "Obstacle",
    "Plan",
    "PlannerError",
    "PoseGoal",
    "PositionGoal",
    "Problem",
    "ProblemError",
    "Robot",
    "RrtikError",
    "Scene",
    "UnknownNameError",
    "World",
    "list_planners",
    "list_problems",
    "list_robots",
    "load_path",
    "load_problem",
    "load_robot",
    "load_scene",
    "plan",
    "save_problem",
    "save_scene",
    "shorten",
    "view",
]
