"""Every pose from outside passes one function: finite, a rotation, right-handed, not beyond the world."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import NOT_RIGID, rigid
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.description.tree import Joint, Solid
from rrtik_ompl.pilot.devices.simulation import SimulatedCamera
from rrtik_ompl.pilot.overlay.augment import Augmenter
from rrtik_ompl.pilot.overlay.virtual_camera import pinhole_camera
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_from_view import SeenObject

BALL = rrtik.Sphere(0.1)
CAMERA = pinhole_camera(64, 48, 1.0)
THING = MarkedObject("thing", "target", (MountedMarker(1, 0.1),))
MAP = MarkerMap("4x4_50", (THING,), pin.SE3.Identity())


def se3(rotation=None, translation=(0.0, 0.0, 0.0)):
    """An SE3 that nobody has checked, as sensor code makes it."""
    made = pin.SE3.Identity()
    made.translation = np.array(translation, dtype=float)
    if rotation is not None:
        made.rotation = np.asarray(rotation, dtype=float)
    return made


BAD = {
    "a position that is not a number": (se3(translation=(np.nan, 0, 0)), "finite"),
    "a position without end": (se3(translation=(0, np.inf, 0)), "finite"),
    "a position far away": (se3(translation=(0, 0, 1e30)), "farther than 1e"),
    "a rotation that is not a number": (se3(np.full((3, 3), np.nan)), "finite"),
    "a rotation that scales": (se3(3.0 * np.eye(3)), "orthonormal"),
    "a rotation of nothing": (se3(np.zeros((3, 3))), "orthonormal"),
    "a rotation that skews": (se3([[1, 1e-5, 0], [0, 1, 0], [0, 0, 1]]), "orthonormal"),
    "a rotation that mirrors": (se3(np.diag([1.0, 1.0, -1.0])), "right-handed"),
}
PLACES = {
    "obstacle": lambda T: rrtik.Obstacle("ball", BALL, T),
    "attached object": lambda T: rrtik.AttachedObject("ball", "tip", BALL, T),
    "motion": lambda T: rrtik.replanning.TimedPoses([0.0, 1.0], [pin.SE3.Identity(), T]),
    "base of a shipped robot": lambda T: rrtik.load_robot("planar3", base_pose=T),
    "tool of a DH table": lambda T: robot_from_dh("arm", [DhRow(a=1.0)], convention="standard", tool=T),
    "joint": lambda T: Joint("turn", "revolute", "base", "hand", T),
    "solid of a link": lambda T: Solid(BALL, T),
    "marker": lambda T: MountedMarker(1, 0.1, T),
    "grasp": lambda T: GraspType("top", [T]),
    "camera of a map": lambda T: MarkerMap("4x4_50", (THING,), T),
    "seen object": lambda T: SeenObject(THING, T, np.zeros((6, 6)), None),
    "simulated camera": lambda T: SimulatedCamera(CAMERA, MAP, rrtik.load_robot("planar3"), rrtik.Scene(), {}, T),
    "simulated object": lambda T: SimulatedCamera(
        CAMERA, MAP, rrtik.load_robot("planar3"), rrtik.Scene(), {"thing": T}, pin.SE3.Identity()
    ),
    "camera of a picture": lambda T: Augmenter(rrtik.load_robot("planar3"), CAMERA).draw(
        np.zeros((48, 64, 3), dtype=np.uint8), T
    ),
    "goal": lambda T: rrtik.PoseGoal(T),
    "region": lambda T: rrtik.TaskRegion(T, np.zeros((6, 2))),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("case", BAD)
def test_no_place_takes_a_pose_that_is_none(place, case):
    pose, message = BAD[case]
    with pytest.raises(InputError, match=message) as caught:
        PLACES[place](pose)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(20))
def test_rounding_is_removed_and_rotations_stay_as_they_are(seed):
    rng = np.random.default_rng(seed)
    exact = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    assert np.array_equal(rigid(exact, "pose").homogeneous, exact.homogeneous)
    rough = se3(exact.rotation + rng.uniform(-1.0, 1.0, (3, 3)) * NOT_RIGID / 8.0, exact.translation)
    mended = rigid(rough, "pose")
    assert np.abs(mended.rotation @ mended.rotation.T - np.eye(3)).max() < 1e-14
    assert np.abs(mended.rotation - rough.rotation).max() < NOT_RIGID


def test_a_pose_that_is_changed_later_does_not_move_the_obstacle():
    place = se3(translation=(1.0, 0.0, 0.0))
    obstacle = rrtik.Obstacle("ball", BALL, place)
    place.translation = np.full(3, np.nan)
    assert np.array_equal(obstacle.pose.translation, [1.0, 0.0, 0.0])


def test_an_obstacle_that_leaves_the_world_is_named():
    fast = rrtik.Scene([rrtik.Obstacle("ball", BALL, motion=rrtik.replanning.ConstantVelocity([1e5, 0.0, 0.0]))])
    assert fast.at(1.0).obstacle("ball").pose.translation[0] == 1e5
    for time, message in ((1e3, "far away"), (np.nan, "time of a scene.*finite"), (1e308, "far away")):
        with pytest.raises(InputError, match=message):
            fast.at(time)


HUGE = {
    "box": lambda x: rrtik.Box([1.0, x, 1.0]),
    "sphere": lambda x: rrtik.Sphere(x),
    "cylinder": lambda x: rrtik.Cylinder(1.0, x),
    "capsule": lambda x: rrtik.Capsule(x, 1.0),
    "half-space": lambda x: rrtik.HalfSpace([0.0, 0.0, 1.0], x),
    "polygon": lambda x: rrtik.Prism([[0, 0], [x, 0], [0, 1]]),
    "mesh": lambda x: rrtik.Mesh([[0, 0, 0], [x, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "velocity": lambda x: rrtik.replanning.ConstantVelocity([0.0, x, 0.0]),
    "margin": lambda x: rrtik.Obstacle("ball", BALL, margin=x),
    "axis": lambda x: Joint("turn", "revolute", "base", "hand", axis=[0.0, 0.0, x]),
}


@pytest.mark.parametrize("number", [1e7, 1e300, np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("place", HUGE)
def test_no_number_reaches_a_table_that_float32_cannot_hold(place, number):
    with pytest.raises(InputError) as caught:
        HUGE[place](number)
    assert "\n" not in str(caught.value)
