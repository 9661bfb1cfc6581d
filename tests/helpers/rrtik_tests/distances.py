"""Signed distances of an arm, and of what it holds, from obstacles: by pinocchio and coal, with none of our code."""

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.shapes import Box, Cylinder, Sphere


def least_distances(robot, scene, rows, step=0.004):
    """Of every link, or thing held, and every obstacle the least along the motions between rows, by names [m]."""
    held = [(each.name, each.link, _geometry(each.shape), each.pose) for each in scene.attached]
    around = [(each.name, _geometry(each.shape), _at(each.pose)) for each in scene.obstacles]
    data, found = robot.model.createData(), {}
    for q in JointPath.of(robot, rows).resample(step).waypoints if len(rows) > 1 else rows:
        pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q[None])[0])
        arm = [
            (robot.model.frames[each.parentFrame].name, each.geometry, data.oMi[each.parentJoint] * each.placement)
            for each in robot.collision.geometryObjects
        ]
        arm += [(name, shape, data.oMf[robot.model.getFrameId(link)] * place) for name, link, shape, place in held]
        for name, shape, place in arm:
            for other, solid, there in around:
                asked = coal.DistanceRequest()
                asked.enable_signed_distance = True
                away = coal.distance(shape, _at(place), solid, there, asked, coal.DistanceResult())
                found[name, other] = min(away, found.get((name, other), np.inf))
    return found


def _at(place):
    return coal.Transform3s(place.rotation, place.translation)


def _geometry(shape):
    if isinstance(shape, Box):
        return coal.Box(*np.asarray(shape.size).tolist())
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.length)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    raise AssertionError(f"no shape of these tests: {shape}")
