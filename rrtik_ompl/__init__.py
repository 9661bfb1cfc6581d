"""Motion planning for robot arms: a robot and a scene, a problem, a plan, a path that has been checked.

What stands here is loaded when it is first used, so that ``import rrtik_ompl`` costs next to nothing.

ARCHITECTURE.md in the repository says where what is, docs/README.md how it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names
from rrtik_ompl.base.version import __version__ as __version__

if TYPE_CHECKING:
    from rrtik_ompl import benchmark as benchmark
    from rrtik_ompl import compat as compat
    from rrtik_ompl import constraints as constraints
    from rrtik_ompl import demos as demos
    from rrtik_ompl import following as following
    from rrtik_ompl import gym as gym
    from rrtik_ompl import ik as ik
    from rrtik_ompl import ompl as ompl
    from rrtik_ompl import replanning as replanning
    from rrtik_ompl import sensing as sensing
    from rrtik_ompl import tip as tip
    from rrtik_ompl.base.errors import InputError as InputError
    from rrtik_ompl.base.errors import NotFoundError as NotFoundError
    from rrtik_ompl.base.errors import PlannerError as PlannerError
    from rrtik_ompl.base.errors import ProblemError as ProblemError
    from rrtik_ompl.base.errors import RrtikError as RrtikError
    from rrtik_ompl.base.poses import pose as pose
    from rrtik_ompl.description.catalog import list_problems as list_problems
    from rrtik_ompl.description.catalog import list_robots as list_robots
    from rrtik_ompl.description.catalog import load_robot as load_robot
    from rrtik_ompl.files.kinds import load as load
    from rrtik_ompl.ik.batch import solve_ik_many as solve_ik_many
    from rrtik_ompl.ik.solve import solve_ik as solve_ik
    from rrtik_ompl.many import plan_many as plan_many
    from rrtik_ompl.model.certificate import Certificate as Certificate
    from rrtik_ompl.model.certificate import TaskCertificate as TaskCertificate
    from rrtik_ompl.model.goal import GoalSet as GoalSet
    from rrtik_ompl.model.goal import JointGoal as JointGoal
    from rrtik_ompl.model.goal import MultiGoal as MultiGoal
    from rrtik_ompl.model.goal import PoseGoal as PoseGoal
    from rrtik_ompl.model.goal import PositionGoal as PositionGoal
    from rrtik_ompl.model.goal_kind import TaskRegion as TaskRegion
    from rrtik_ompl.model.judgement import MotionVerdict as MotionVerdict
    from rrtik_ompl.model.path import JointPath as JointPath
    from rrtik_ompl.model.robot import Robot as Robot
    from rrtik_ompl.model.scene import AttachedObject as AttachedObject
    from rrtik_ompl.model.scene import Obstacle as Obstacle
    from rrtik_ompl.model.scene import Scene as Scene
    from rrtik_ompl.model.scene import Touching as Touching
    from rrtik_ompl.model.shapes import Box as Box
    from rrtik_ompl.model.shapes import Capsule as Capsule
    from rrtik_ompl.model.shapes import Cylinder as Cylinder
    from rrtik_ompl.model.shapes import HalfSpace as HalfSpace
    from rrtik_ompl.model.shapes import HeightField as HeightField
    from rrtik_ompl.model.shapes import Mesh as Mesh
    from rrtik_ompl.model.shapes import Octree as Octree
    from rrtik_ompl.model.shapes import PointCloud as PointCloud
    from rrtik_ompl.model.shapes import Prism as Prism
    from rrtik_ompl.model.shapes import Sphere as Sphere
    from rrtik_ompl.motion.received import ReceivedMotion as ReceivedMotion
    from rrtik_ompl.motion.received import load_motions as load_motions
    from rrtik_ompl.motion.received import prove as prove
    from rrtik_ompl.motion.trajectory import RateLimits as RateLimits
    from rrtik_ompl.motion.trajectory import Trajectory as Trajectory
    from rrtik_ompl.motion.trajectory import time_parameterize as time_parameterize
    from rrtik_ompl.motion.trajectory import time_parameterize_many as time_parameterize_many
    from rrtik_ompl.ompl_bridge.planner_names import list_planners as list_planners
    from rrtik_ompl.planning.moves.staircase import one_joint_moves as one_joint_moves
    from rrtik_ompl.planning.outcome import Plan as Plan
    from rrtik_ompl.planning.plan import plan as plan
    from rrtik_ompl.planning.search.roadmap import Roadmap as Roadmap
    from rrtik_ompl.planning.shortening import MoveRules as MoveRules
    from rrtik_ompl.planning.shortening import shorten as shorten
    from rrtik_ompl.problem_files.problem import load_problem as load_problem
    from rrtik_ompl.problem_files.scene import load_scene as load_scene
    from rrtik_ompl.replanning.replanner import replan as replan
    from rrtik_ompl.tasks import Alternatives as Alternatives
    from rrtik_ompl.tasks import Attach as Attach
    from rrtik_ompl.tasks import Detach as Detach
    from rrtik_ompl.tasks import Gripper as Gripper
    from rrtik_ompl.tasks import MoveTo as MoveTo
    from rrtik_ompl.tasks import Stage as Stage
    from rrtik_ompl.tasks import Straight as Straight
    from rrtik_ompl.tasks import Task as Task
    from rrtik_ompl.tasks import TaskPlan as TaskPlan
    from rrtik_ompl.tasks import Variation as Variation
    from rrtik_ompl.tasks.grasps import Grasp as Grasp
    from rrtik_ompl.tasks.grasps import grasps as grasps
    from rrtik_ompl.tasks.task_file import list_tasks as list_tasks
    from rrtik_ompl.viewer import view as view
    from rrtik_ompl.viewer.film import film as film
    from rrtik_ompl.viewer.film import picture as picture
    from rrtik_ompl.viewer.plots.joints import plot_joints as plot_joints
    from rrtik_ompl.world.problem import Problem as Problem
    from rrtik_ompl.world.world import World as World
else:
    _HOMES = {
        "base.errors": (
            "InputError",
            "NotFoundError",
            "PlannerError",
            "ProblemError",
            "RrtikError",
        ),
        "base.poses": ("pose",),
        "model.robot": ("Robot",),
        "model.shapes": (
            "Box",
            "Capsule",
            "Cylinder",
            "HalfSpace",
            "HeightField",
            "Mesh",
            "Octree",
            "PointCloud",
            "Prism",
            "Sphere",
        ),
        "model.scene": (
            "AttachedObject",
            "Obstacle",
            "Scene",
            "Touching",
        ),
        "model.goal": (
            "GoalSet",
            "JointGoal",
            "MultiGoal",
            "PoseGoal",
            "PositionGoal",
        ),
        "model.goal_kind": ("TaskRegion",),
        "model.path": ("JointPath",),
        "model.certificate": (
            "Certificate",
            "TaskCertificate",
        ),
        "files.kinds": ("load",),
        "description.catalog": (
            "list_problems",
            "list_robots",
            "load_robot",
        ),
        "world.world": ("World",),
        "world.problem": ("Problem",),
        "problem_files.problem": ("load_problem",),
        "problem_files.scene": ("load_scene",),
        "planning.outcome": ("Plan",),
        "planning.plan": ("plan",),
        "ompl_bridge.planner_names": ("list_planners",),
        "many": ("plan_many",),
        "planning.shortening": (
            "MoveRules",
            "shorten",
        ),
        "planning.moves.staircase": ("one_joint_moves",),
        "planning.search.roadmap": ("Roadmap",),
        "ik.solve": ("solve_ik",),
        "ik.batch": ("solve_ik_many",),
        "model.judgement": ("MotionVerdict",),
        "motion.received": (
            "ReceivedMotion",
            "load_motions",
            "prove",
        ),
        "motion.trajectory": (
            "RateLimits",
            "Trajectory",
            "time_parameterize",
            "time_parameterize_many",
        ),
        "replanning.replanner": ("replan",),
        "tasks": (
            "Alternatives",
            "Attach",
            "Detach",
            "Gripper",
            "MoveTo",
            "Stage",
            "Straight",
            "Task",
            "TaskPlan",
            "Variation",
        ),
        "tasks.grasps": (
            "Grasp",
            "grasps",
        ),
        "tasks.task_file": ("list_tasks",),
        "viewer": ("view",),
        "viewer.film": ("film", "picture"),
        "viewer.plots.joints": ("plot_joints",),
    }
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        _HOMES,
        (
            "benchmark",
            "compat",
            "constraints",
            "demos",
            "following",
            "gym",
            "ik",
            "ompl",
            "replanning",
            "sensing",
            "tip",
        ),
    )

    _NOTEBOOK = "viewer.notebook"

    def html_of(value: object) -> str | None:
        """What a notebook shows of a value (`_repr_html_`), or None."""
        drawn: str | None = import_module(f"rrtik_ompl.{_NOTEBOOK}").html_of(value)
        return drawn

    def png_of(value: object) -> bytes | None:
        """The picture of a value in a printed notebook (`_repr_png_`), or None."""
        drawn: bytes | None = import_module(f"rrtik_ompl.{_NOTEBOOK}").png_of(value)
        return drawn
