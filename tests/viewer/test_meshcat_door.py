"""What `view(..., meshcat=)` draws into a server of meshcat's own, read back from the page that the server makes."""

import re
from base64 import b64decode

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import rrtik_ompl as rrtik

meshcat = pytest.importorskip("meshcat")
EXTENSIONS = {0x16: np.uint32, 0x17: np.float32}


@pytest.fixture(scope="module")
def server():
    """A visualizer, whose server is a process of its own."""
    visualizer = meshcat.Visualizer()
    yield visualizer
    process = visualizer.window.server_proc
    process.terminate()
    process.wait(timeout=30)


def drawn_by(server):
    """What the server would send to a browser: objects, transforms and animations by their paths."""
    kinds = {"set_object": {}, "set_transform": {}, "set_animation": {}}
    for text in re.findall(r'fetch\("data:application/octet-binary;base64,([^"]*)"\)', server.static_html()):
        command = umsgpack.unpackb(b64decode(text))
        if command["type"] in kinds:
            kinds[command["type"]][command.get("path", "")] = command
    return kinds


def pose_of(transforms, path):
    """The pose of a node in the world: the product of the matrices above it."""
    pose, steps = np.eye(4), path.split("/")
    for count in range(2, len(steps) + 1):
        found = transforms.get("/".join(steps[:count]))
        if found is not None:
            pose = pose @ np.reshape(found["matrix"], (4, 4)).T
    return pose


@pytest.mark.kernels
def test_the_server_has_arm_obstacles_and_motion_where_pinocchio_has_them(server):
    problem = rrtik.load_problem("ur5_table")
    plan = rrtik.plan(problem, "fastrrtconnect", seed=1)
    server["mine"].set_object(meshcat.geometry.Box([0.1, 0.1, 0.1]))
    assert rrtik.view(rrtik.Scene([rrtik.Obstacle("old", rrtik.Sphere(0.1))]), meshcat=server) is None
    assert rrtik.view(plan, meshcat=server) is None

    found = drawn_by(server)
    objects, transforms = found["set_object"], found["set_transform"]
    assert "/meshcat/mine" in objects  # what others have drawn there stays
    assert not any(path.endswith("/:old") for path in objects)  # and what we had drawn goes

    # Obstacles: size and place, of boxes.
    boxes = [each for each in problem.world.scene.obstacles if isinstance(each.shape, rrtik.Box)]
    assert boxes
    for each in boxes:
        (path,) = (path for path in objects if path.startswith(f"/meshcat/rrtik/obstacles/:{each.name}"))
        (geometry,) = objects[path]["object"]["geometries"]
        drawn = pose_of(transforms, path)
        if geometry["type"] == "BoxGeometry":
            assert np.allclose([geometry[side] for side in ("width", "height", "depth")], each.shape.size, atol=1e-4)
        else:
            attribute = geometry["data"]["attributes"]["position"]["array"]
            points = np.frombuffer(attribute.data, EXTENSIONS[attribute.type]).reshape(-1, 3)
            assert np.allclose(np.ptp(points, axis=0), each.shape.size, atol=1e-3)
        assert np.allclose(drawn[:3, 3], each.pose.translation, atol=1e-6)

    # The arm: at the start and the goal, and along the animation, as pinocchio's own kinematics has it.
    model = problem.robot.model
    data = model.createData()
    (animation,) = found["set_animation"].values()
    tracks = {
        clip["path"]: {track["name"]: track["keys"] for track in clip["clip"]["tracks"]}
        for clip in animation["animations"]
    }
    ends = {"robot": plan.path.start, "goal ghost": plan.path.end}
    for number in range(1, model.njoints):
        name = f":{model.names[number]}"
        for group, q in ends.items():
            pin.forwardKinematics(model, data, q)
            place = pose_of(transforms, f"/meshcat/rrtik/{group}/{name}")
            assert np.allclose(place, data.oMi[number].homogeneous, atol=1e-9)
        keys = tracks[f"/meshcat/rrtik/robot/{name}"]
        for key, q in ((0, plan.path.start), (-1, plan.path.end)):
            pin.forwardKinematics(model, data, q)
            assert np.allclose(keys[".position"][key]["value"], data.oMi[number].translation, atol=1e-9)
            turned = pin.Quaternion(np.array(keys[".quaternion"][key]["value"])).toRotationMatrix()
            assert np.allclose(turned, data.oMi[number].rotation, atol=1e-9)


def test_pinocchios_visualizer_is_taken_and_what_is_none_is_refused(server):
    from pinocchio.visualize import MeshcatVisualizer

    robot = rrtik.load_robot("planar3")
    visualizer = MeshcatVisualizer(robot.model, robot.collision, robot.visual)
    with pytest.raises(rrtik.InputError, match=r"got a MeshcatVisualizer; call its initViewer\(\) first"):
        rrtik.view(robot, meshcat=visualizer)
    visualizer.initViewer(viewer=server)
    rrtik.view(robot, meshcat=visualizer)
    assert any(path.startswith("/meshcat/rrtik/robot/") for path in drawn_by(server)["set_object"])

    with pytest.raises(rrtik.InputError, match=r"expected a meshcat\.Visualizer, .* got a str"):
        rrtik.view(robot, meshcat="http://127.0.0.1:7000")
    with pytest.raises(rrtik.InputError, match="html or meshcat"):
        rrtik.view(robot, meshcat=server, html="page.html")
