"""The others: roboplan, VAMP, and OMPL's RRT-Connect with a validity callback in Python. Whoever is missing says so."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from rrtik_ompl import Problem, World
from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.ompl_bridge.attempt import quiet
from rrtik_ompl.ompl_bridge.setup import exact_path
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.shapes import Box, Capsule, Cylinder, Sphere

RANGE = 1.0  # [rad], as VAMP's for the Panda
PER_RADIAN = 32.0  # checks, as VAMP's
VAMP_SAMPLES = 100_000  # its default, a million, costs 0.5 ms of allocation in every call
MOST_NODES = 1_000_000
HAS_ROBOPLAN = find_spec("roboplan") is not None
HAS_VAMP = find_spec("vamp") is not None


def package_version(name: str) -> str:
    """The version of an installed package, or that it is missing."""
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"{name} not installed"


def roboplan_search(problem: Problem, urdf: Path, seconds: float) -> Callable[[int], Matrix | None]:
    """RRT-Connect of roboplan on the same robot description and obstacles; from a seed to a path."""
    from roboplan import core, rrt

    scene = core.Scene("arm", core.loadUrdfSceneDescriptionFromXml(_urdf_text(urdf), [str(urdf.parent)]))
    scene.importSrdf((urdf.parent / "panda.srdf").read_text())
    names = [name for item in problem.world.scene.obstacles for name in _add(scene, core, item)]
    # between each other obstacles touch, which would make every configuration collide
    scene.setCollisions(list(combinations(names, 2)), False)
    options = rrt.RRTOptions(
        group_name="panda_arm",
        max_nodes=MOST_NODES,
        max_connection_distance=RANGE,
        collision_check_step_size=1.0 / PER_RADIAN,
        max_planning_time=seconds,
        rrt_connect=True,
    )
    planner, joints = rrt.RRT(scene, options), list(problem.world.robot.joint_names)
    ends = [core.JointConfiguration(joints, np.array(q)) for q in (problem.start, problem.goal.q)]  # type: ignore[union-attr]

    def solve(seed: int) -> Matrix | None:
        planner.setRngSeed(seed)
        try:
            return np.array(planner.plan(*ends).positions)
        except RuntimeError:  # its word for "not found"
            return None

    return solve


@cache
def _urdf_text(urdf: Path) -> str:
    return urdf.read_text().replace("package://meshes", str(urdf.parent.resolve() / "meshes"))


def _add(scene: Any, core: Any, item: Any) -> list[str]:
    """Add an obstacle to a scene of roboplan; a capsule becomes a cylinder and two balls. Returns the names."""
    shape, white = item.shape, np.ones(4)
    place = np.asfortranarray(item.pose.homogeneous)
    if isinstance(shape, Box):
        scene.addBoxGeometry(item.name, "universe", core.Box(*shape.size), place, white)
        return [item.name]
    if isinstance(shape, Sphere):
        scene.addSphereGeometry(item.name, "universe", core.Sphere(shape.radius), place, white)
        return [item.name]
    scene.addCylinderGeometry(item.name, "universe", core.Cylinder(shape.radius, shape.length), place, white)
    if isinstance(shape, Cylinder):
        return [item.name]
    names = [f"{item.name}, cap {k}" for k in (0, 1)]
    for name, height in zip(names, (-0.5 * shape.length, 0.5 * shape.length), strict=True):
        cap = np.asfortranarray((item.pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))).homogeneous)
        scene.addSphereGeometry(name, "universe", core.Sphere(shape.radius), cap, white)
    return [item.name, *names]


def vamp_search(problem: Problem) -> Callable[[], tuple[bool, float]]:
    """RRT-Connect of VAMP on the same obstacles: whether solved, and the seconds that it says it took."""
    import vamp

    module, plan, settings, _ = vamp.configure_robot_and_planner_with_kwargs("panda", "rrtc")
    settings.max_samples = VAMP_SAMPLES
    scene = vamp.Environment()
    for item in problem.world.scene.obstacles:
        place, turn, shape = item.pose.translation, pin.rpy.matrixToRpy(item.pose.rotation), item.shape
        if isinstance(shape, Box):
            scene.add_cuboid(vamp.Cuboid(place, turn, 0.5 * shape.size))
        elif isinstance(shape, Capsule):
            scene.add_capsule(vamp.Cylinder(place, turn, shape.radius, shape.length))
        else:
            scene.add_sphere(vamp.Sphere(place, shape.radius))
    start, goal = problem.start, problem.goal.q  # type: ignore[union-attr]

    def solve() -> tuple[bool, float]:
        result = plan(start, goal, scene, settings, module.halton())
        return bool(result.solved), 1e-9 * float(result.nanoseconds)

    return solve


class PlainChecks:
    """What a user of Pinocchio writes: one configuration, all pairs or a broadphase, stop at the first collision.

    Args:
        world: Robot, obstacles and the pairs to check.
        as_loaded: Links keep their triangle meshes; otherwise they are the solids that a World checks.
        broadphase: Whether to ask a tree of bounding boxes.
    """

    def __init__(self, world: World, *, as_loaded: bool, broadphase: bool) -> None:
        robot, geometry = world.robot, pin.GeometryModel()
        loaded = [item.geometry for item in robot.collision.geometryObjects] if as_loaded else []
        solids = [*loaded, *(body.geometry for body in world.bodies[len(loaded) :])]
        for number, (body, solid) in enumerate(zip(world.bodies, solids, strict=True)):
            geometry.addGeometryObject(pin.GeometryObject(str(number), body.joint, body.placement, solid))
        for first, second in world.pairs:
            geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._model, self._data = robot.model, robot.model.createData()
        self._geometry, self._geometry_data = geometry, pin.GeometryData(geometry)
        plain = (geometry, self._geometry_data)
        tree = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager
        self._checked = (tree(self._model, *plain),) if broadphase else plain
        self._lift = robot.lift

    def free(self, full: Vector) -> bool:
        """Whether Pinocchio's configuration vector is free of collision."""
        return not pin.computeCollisions(self._model, self._data, *self._checked, full, True)

    def valid_batch(self, Q: Matrix) -> list[bool]:
        """The same for rows of configurations."""
        return [self.free(full) for full in self._lift(Q)]


def callback_search(problem: Problem, *, broadphase: bool, seconds: float) -> Callable[[int], Matrix | None]:
    """OMPL's RRT-Connect that asks Python about one configuration at a time, on meshes; from a seed to a path."""
    robot = problem.world.robot
    checks = PlainChecks(problem.world, as_loaded=True, broadphase=broadphase)

    def solve(seed: int) -> Matrix | None:
        with quiet():
            ou.RNG.setSeed(1 + seed)  # which OMPL grumbles about from the second time on
        space, bounds = ob.RealVectorStateSpace(robot.dof), ob.RealVectorBounds(robot.dof)
        for k in range(robot.dof):
            bounds.setLow(k, float(robot.lower[k]))
            bounds.setHigh(k, float(robot.upper[k]))
        space.setBounds(bounds)
        setup = og.SimpleSetup(space)
        si = setup.getSpaceInformation()
        states, ends = StateIO(si), [si.allocState(), si.allocState()]
        setup.setStateValidityChecker(lambda state: checks.free(states.read(state)))
        si.setStateValidityCheckingResolution(1.0 / PER_RADIAN / space.getMaximumExtent())
        for state, q in zip(ends, (problem.start, problem.goal.q), strict=True):  # type: ignore[union-attr]
            states.write(state, q)
        setup.setStartAndGoalStates(*ends)
        planner = og.RRTConnect(si)
        planner.setRange(RANGE)
        setup.setPlanner(planner)
        setup.solve(ob.timedPlannerTerminationCondition(seconds))
        return exact_path(setup.getProblemDefinition(), si)

    return solve
