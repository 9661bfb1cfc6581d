"""Motion planning for robot arms: a robot and a scene, a problem, a plan, a path that has been checked.

What stands here is loaded when it is first used, so that ``import rrtik_ompl`` costs next to nothing.

ARCHITECTURE.md in the repository says where what is, docs/README.md how it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rrtik_ompl.base.version import __version__ as __version__

if TYPE_CHECKING:
    from rrtik_ompl.base.errors import InputError as InputError
    from rrtik_ompl.base.errors import PlannerError as PlannerError
    from rrtik_ompl.base.errors import ProblemError as ProblemError
    from rrtik_ompl.base.errors import RrtikError as RrtikError
    from rrtik_ompl.base.errors import UnknownNameError as UnknownNameError
    from rrtik_ompl.base.poses import pose as pose
    from rrtik_ompl.benchmark.batch import plan_batch as plan_batch
    from rrtik_ompl.constraints.shorthands import inside as inside
    from rrtik_ompl.constraints.shorthands import on_line as on_line
    from rrtik_ompl.constraints.shorthands import on_plane as on_plane
    from rrtik_ompl.constraints.shorthands import orientation_of as orientation_of
    from rrtik_ompl.constraints.shorthands import upright as upright
    from rrtik_ompl.description.catalog import list_problems as list_problems
    from rrtik_ompl.description.catalog import list_robots as list_robots
    from rrtik_ompl.description.catalog import load_robot as load_robot
    from rrtik_ompl.description.shapes.cloud import load_cloud as load_cloud
    from rrtik_ompl.description.shapes.cloud import save_cloud as save_cloud
    from rrtik_ompl.description.shapes.heights import load_height_field as load_height_field
    from rrtik_ompl.description.shapes.mesh import load_mesh as load_mesh
    from rrtik_ompl.description.shapes.octree import load_octree as load_octree
    from rrtik_ompl.description.variants import narrowed as narrowed
    from rrtik_ompl.description.variants import padded as padded
    from rrtik_ompl.description.variants import scaled as scaled
    from rrtik_ompl.description.variants import weighted as weighted
    from rrtik_ompl.ik.batch import IkBatch as IkBatch
    from rrtik_ompl.ik.batch import solve_ik_batch as solve_ik_batch
    from rrtik_ompl.ik.reach import ReachMap as ReachMap
    from rrtik_ompl.ik.reach import load_reach_map as load_reach_map
    from rrtik_ompl.ik.reach import reach_map as reach_map
    from rrtik_ompl.ik.solve import IkResult as IkResult
    from rrtik_ompl.ik.solve import list_ik_methods as list_ik_methods
    from rrtik_ompl.ik.solve import solve_ik as solve_ik
    from rrtik_ompl.ik.trajectory import IkTrajectory as IkTrajectory
    from rrtik_ompl.ik.trajectory import solve_ik_trajectory as solve_ik_trajectory
    from rrtik_ompl.model.certificate import Certificate as Certificate
    from rrtik_ompl.model.certificate import load_certificate as load_certificate
    from rrtik_ompl.model.goal import GoalSet as GoalSet
    from rrtik_ompl.model.goal import JointGoal as JointGoal
    from rrtik_ompl.model.goal import MultiGoal as MultiGoal
    from rrtik_ompl.model.goal import PoseGoal as PoseGoal
    from rrtik_ompl.model.goal import PositionGoal as PositionGoal
    from rrtik_ompl.model.goal_kind import TaskRegion as TaskRegion
    from rrtik_ompl.model.path import JointPath as JointPath
    from rrtik_ompl.model.path import load_path as load_path
    from rrtik_ompl.model.robot import Robot as Robot
    from rrtik_ompl.model.scene import AttachedObject as AttachedObject
    from rrtik_ompl.model.scene import ConstantVelocity as ConstantVelocity
    from rrtik_ompl.model.scene import Obstacle as Obstacle
    from rrtik_ompl.model.scene import Scene as Scene
    from rrtik_ompl.model.scene import TimedPoses as TimedPoses
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
    from rrtik_ompl.motion.following.follower import Followed as Followed
    from rrtik_ompl.motion.following.follower import Follower as Follower
    from rrtik_ompl.motion.following.follower import RobotLink as RobotLink
    from rrtik_ompl.motion.following.follower import SimulatedLink as SimulatedLink
    from rrtik_ompl.motion.following.servo import Servo as Servo
    from rrtik_ompl.motion.trajectory import RateLimits as RateLimits
    from rrtik_ompl.motion.trajectory import Trajectory as Trajectory
    from rrtik_ompl.motion.trajectory import load_trajectory as load_trajectory
    from rrtik_ompl.motion.trajectory import motion_report as motion_report
    from rrtik_ompl.motion.trajectory import time_parameterize as time_parameterize
    from rrtik_ompl.ompl_bridge import objectives as objectives
    from rrtik_ompl.ompl_bridge.benchmark_notes import BenchmarkNotes as BenchmarkNotes
    from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler as GoalSampler
    from rrtik_ompl.ompl_bridge.simple_setup import simple_setup as simple_setup
    from rrtik_ompl.ompl_bridge.simple_setup import space_information as space_information
    from rrtik_ompl.planning.many import plan_many as plan_many
    from rrtik_ompl.planning.moves.staircase import one_joint_moves as one_joint_moves
    from rrtik_ompl.planning.plan import Plan as Plan
    from rrtik_ompl.planning.plan import list_planners as list_planners
    from rrtik_ompl.planning.plan import plan as plan
    from rrtik_ompl.planning.search.roadmap import Roadmap as Roadmap
    from rrtik_ompl.planning.search.roadmap import load_roadmap as load_roadmap
    from rrtik_ompl.planning.shortening import MoveRules as MoveRules
    from rrtik_ompl.planning.shortening import shorten as shorten
    from rrtik_ompl.planning.tip_motion import StraightResult as StraightResult
    from rrtik_ompl.planning.tip_motion import arc as arc
    from rrtik_ompl.planning.tip_motion import linear as linear
    from rrtik_ompl.planning.tip_motion import screw as screw
    from rrtik_ompl.planning.tip_motion import straight as straight
    from rrtik_ompl.problem_files.problem import load_problem as load_problem
    from rrtik_ompl.problem_files.problem import save_problem as save_problem
    from rrtik_ompl.problem_files.scene import load_scene as load_scene
    from rrtik_ompl.problem_files.scene import save_scene as save_scene
    from rrtik_ompl.replanning import ReplanRun as ReplanRun
    from rrtik_ompl.replanning import load_run as load_run
    from rrtik_ompl.replanning import replan as replan
    from rrtik_ompl.replanning.in_time import TimedPlan as TimedPlan
    from rrtik_ompl.replanning.in_time import plan_in_time as plan_in_time
    from rrtik_ompl.replanning.scenario import Scenario as Scenario
    from rrtik_ompl.replanning.scenario import load_scenario as load_scenario
    from rrtik_ompl.tasks import Alternatives as Alternatives
    from rrtik_ompl.tasks import Attach as Attach
    from rrtik_ompl.tasks import Detach as Detach
    from rrtik_ompl.tasks import Gripper as Gripper
    from rrtik_ompl.tasks import MoveTo as MoveTo
    from rrtik_ompl.tasks import Straight as Straight
    from rrtik_ompl.tasks import Task as Task
    from rrtik_ompl.tasks import TaskPlan as TaskPlan
    from rrtik_ompl.tasks.plan_file import load_task_plan as load_task_plan
    from rrtik_ompl.tasks.plan_file import save_task_plan as save_task_plan
    from rrtik_ompl.tasks.task_file import list_tasks as list_tasks
    from rrtik_ompl.tasks.task_file import load_task as load_task
    from rrtik_ompl.tasks.through import PlanThrough as PlanThrough
    from rrtik_ompl.tasks.through import plan_through as plan_through
    from rrtik_ompl.tasks.timed import TimedTask as TimedTask
    from rrtik_ompl.tasks.timed import time_task as time_task
    from rrtik_ompl.viewer import view as view
    from rrtik_ompl.viewer.plots.joints import plot_joints as plot_joints
    from rrtik_ompl.world.certificates import certificate_of as certificate_of
    from rrtik_ompl.world.certificates import verify_certificate as verify_certificate
    from rrtik_ompl.world.problem import Problem as Problem
    from rrtik_ompl.world.robot_points import without_robot as without_robot
    from rrtik_ompl.world.world import World as World
else:
    _HOMES = {
        "description.catalog": ("list_problems", "list_robots", "load_robot"),
        "benchmark.batch": ("plan_batch",),
        "model.certificate": ("Certificate", "load_certificate"),
        "world.certificates": ("certificate_of", "verify_certificate"),
        "description.variants": ("narrowed", "padded", "scaled", "weighted"),
        "constraints.shorthands": ("inside", "on_line", "on_plane", "orientation_of", "upright"),
        "base.errors": ("InputError", "PlannerError", "ProblemError", "RrtikError", "UnknownNameError"),
        "motion.following.follower": ("Followed", "Follower", "RobotLink", "SimulatedLink"),
        "motion.following.servo": ("Servo",),
        "model.goal": ("GoalSet", "JointGoal", "MultiGoal", "PoseGoal", "PositionGoal"),
        "ik.batch": ("IkBatch", "solve_ik_batch"),
        "ik.solve": ("IkResult", "list_ik_methods", "solve_ik"),
        "ik.trajectory": ("IkTrajectory", "solve_ik_trajectory"),
        "ompl_bridge": ("objectives",),
        "ompl_bridge.goal_sampler": ("GoalSampler",),
        "ompl_bridge.benchmark_notes": ("BenchmarkNotes",),
        "ompl_bridge.simple_setup": ("simple_setup", "space_information"),
        "description.shapes.cloud": ("load_cloud", "save_cloud"),
        "description.shapes.heights": ("load_height_field",),
        "description.shapes.mesh": ("load_mesh",),
        "description.shapes.octree": ("load_octree",),
        "planning.moves.staircase": ("one_joint_moves",),
        "model.path": ("JointPath", "load_path"),
        "planning.plan": ("Plan", "list_planners", "plan"),
        "planning.many": ("plan_many",),
        "viewer.plots.joints": ("plot_joints",),
        "base.poses": ("pose",),
        "world.problem": ("Problem",),
        "problem_files.problem": ("load_problem", "save_problem"),
        "ik.reach": ("ReachMap", "load_reach_map", "reach_map"),
        "replanning": ("ReplanRun", "load_run", "replan"),
        "model.robot": ("Robot",),
        "replanning.in_time": ("TimedPlan", "plan_in_time"),
        "replanning.scenario": ("Scenario", "load_scenario"),
        "model.scene": ("AttachedObject", "ConstantVelocity", "Obstacle", "Scene", "TimedPoses", "Touching"),
        "problem_files.scene": ("load_scene", "save_scene"),
        "planning.search.roadmap": ("Roadmap", "load_roadmap"),
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
        "planning.shortening": ("MoveRules", "shorten"),
        "model.goal_kind": ("TaskRegion",),
        "tasks": ("Alternatives", "Attach", "Detach", "Gripper", "MoveTo", "Straight", "Task", "TaskPlan"),
        "tasks.plan_file": ("load_task_plan", "save_task_plan"),
        "tasks.task_file": ("list_tasks", "load_task"),
        "planning.tip_motion": ("StraightResult", "arc", "linear", "screw", "straight"),
        "tasks.through": ("PlanThrough", "plan_through"),
        "tasks.timed": ("TimedTask", "time_task"),
        "motion.trajectory": ("RateLimits", "Trajectory", "load_trajectory", "motion_report", "time_parameterize"),
        "viewer": ("view",),
        "world.robot_points": ("without_robot",),
        "world.world": ("World",),
    }
    _HOME_OF = {name: module for module, names in _HOMES.items() for name in names}
    __all__ = sorted(_HOME_OF)
    _NOTEBOOK = "viewer.notebook"

    def html_of(value: object) -> str | None:
        """What a notebook shows of a value (`_repr_html_`), or None."""
        drawn: str | None = import_module(f"rrtik_ompl.{_NOTEBOOK}").html_of(value)
        return drawn

    RENAMED = {"GoalRegion": "GoalSet", "Run": "ReplanRun", "Waypoints": "TimedPoses", "timed": "time_parameterize"}

    def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever has that name
        if name in RENAMED:  # Python would hide an AttributeError from ``from rrtik_ompl import``
            raise ImportError(f"rrtik_ompl.{name} is now rrtik_ompl.{RENAMED[name]}")
        if name not in _HOME_OF:
            raise AttributeError(f"module 'rrtik_ompl' has no attribute '{name}'")
        value = getattr(import_module(f"rrtik_ompl.{_HOME_OF[name]}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return [*__all__, "__version__"]
