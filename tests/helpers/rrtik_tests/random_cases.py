"""Random arms, solids and surroundings, each with a slow and obvious check in float64 beside the kernels."""

from functools import cache

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.solids import bvh, hull
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.checks import check_kernels as kernels
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables import robot_tables as tables

SLIDER = """
<robot name="slider"><link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.2" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-0.5" upper="0.5" velocity="1" effort="1"/></joint>
  <joint name="swing" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0" rpy="0 0.4 1"/>
    <axis xyz="1 2 -2"/></joint>
  <joint name="left" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.3 0.1 0"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.2" velocity="1" effort="1"/></joint>
  <joint name="right" type="prismatic"><parent link="b"/><child link="d"/><origin xyz="0.3 -0.1 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.2" velocity="1" effort="1"/><mimic joint="left"/></joint>
  <joint name="nod" type="revolute"><parent link="b"/><child link="e"/><origin xyz="0 0 0.3"/><axis xyz="0 0 -1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/><mimic joint="swing" multiplier="-0.5" offset="0.2"/></joint>
</robot>"""
FREE_POINT = "".join(
    f"""<joint name="{a}" type="prismatic"><parent link="{p}"/><child link="{c}"/><axis xyz="{x}"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint><link name="{c}"/>"""
    for a, p, c, x in (("x", "o", "p", "1 0 0"), ("y", "p", "q", "0 1 0"), ("z", "q", "r", "0 0 1"))
)
DESCRIBED = {"slider": SLIDER, "free point": f'<robot name="point"><link name="o"/>{FREE_POINT}</robot>'}
ARMS = ("titan4", "panda", "kinova", "puma560", "planar10", "slider")


@cache
def arm(name):
    return robot_from_urdf_text(DESCRIBED[name]) if name in DESCRIBED else load_robot(name)


def configurations(robot, count, rng):
    return rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (count, robot.dof))


def joint_values(robot, Q):
    return Q @ robot.chain.gain.T + robot.chain.offset


def random_pose(rng, reach):
    return pin.SE3(pin.Quaternion(*rng.normal(size=4)).normalized().matrix(), rng.uniform(-reach, reach, 3))


def random_solid(kind, rng, size):
    a, b, c = rng.uniform(0.1, 0.5, 3) * size
    if kind == "half-space":
        normal = rng.normal(size=3)
        return coal.Halfspace(normal / np.linalg.norm(normal), -0.5 * size)
    if kind in ("convex", "round convex"):
        points = rng.normal(size=(12 if kind == "convex" else 150, 3))
        return hull(points / np.linalg.norm(points, axis=1)[:, None] * (a, b, c))
    if kind == "mesh":
        return bvh(rng.normal(size=(6, 3)) * size * 0.2, np.array([[0, 1, 2], [2, 3, 4], [3, 4, 5]]))
    return {
        "ball": lambda: coal.Sphere(a),
        "capsule": lambda: coal.Capsule(0.5 * a, b),
        "box": lambda: coal.Box(a, b, c),
        "cylinder": lambda: coal.Cylinder(a, b),
    }[kind]()


KINDS = ("ball", "capsule", "box", "cylinder", "half-space", "convex", "round convex", "mesh")


def random_spheres(rng, count, size):
    """Outer spheres of random places and sizes, and inner ones inside them."""
    outer = np.column_stack([rng.normal(size=(count, 3)) * 0.1 * size, rng.uniform(0.02, 0.1, count) * size])
    return outer, outer[: rng.integers(0, count + 1)] * (1.0, 1.0, 1.0, 0.6)


def inscribed(solid):
    """A ball inside a convex solid, shape (1, 4)."""
    centre = np.mean(solid.points(), axis=0)
    return np.array([[*centre, -0.9 * float(distance(solid, centre))]])


class Case:
    """An arm with random balls on its joints among random solids, some pairs left out."""

    def __init__(self, name, seed, *, kinds=KINDS, size=None, most_balls=20):
        rng = np.random.default_rng(seed)
        self.robot = arm(name)
        joints = len(self.robot.chain.parent)
        tip = np.linalg.norm(self.robot.fk_batch(configurations(self.robot, 50, rng))[:, :3, 3], axis=1).max()
        self.size = size or 0.6 * float(tip)
        self.bodies, self.outer, self.inner = [], [], []
        for kind in kinds:
            pose = random_pose(rng, 1.5 * self.size)
            solid = random_solid(kind, rng, self.size)
            spheres = random_spheres(rng, 5, 2.0 * self.size) if kind == "mesh" else ([], [])
            spheres = ([], inscribed(solid)) if isinstance(solid, coal.ConvexBase) else spheres
            self._add(Body(kind, 0, pose, solid, "obstacle"), spheres)
        for joint in [*range(1, joints + 1), *rng.integers(1, joints + 1, 2)]:
            count = int(rng.integers(1, most_balls + 1))
            body = Body(f"link{joint}", int(joint), random_pose(rng, 0.1), coal.Sphere(0.1), "link")
            self._add(body, random_spheres(rng, count, 0.5 * self.size))
        order = rng.permutation(len(self.bodies))
        self.bodies, self.outer, self.inner = ([c[k] for k in order] for c in (self.bodies, self.outer, self.inner))
        count = len(self.bodies)
        every = [(i, j) for i in range(count) for j in range(i + 1, count)]
        self.pairs = [p for p in every if rng.random() < 0.6 and self.bodies[p[0]].joint != self.bodies[p[1]].joint]
        self.world = FastWorld(self.robot.chain, self.bodies, self.pairs, outer=self.outer, inner=self.inner)
        self.rng = rng

    def _add(self, body, spheres):
        body.geometry.computeLocalAABB()
        self.bodies.append(body)
        self.outer.append(np.array(spheres[0]).reshape(-1, 4))
        self.inner.append(np.array(spheres[1]).reshape(-1, 4))

    def sample(self, count):
        return configurations(self.robot, count, self.rng)

    def meetings(self, Q, covers, *, inner, grow=0.0):
        """For each pair: which configurations have overlapping balls, those of moving bodies grown. (m, pairs)."""
        frames = self.robot.joint_frames(Q)
        placed = {}
        for k, body in enumerate(self.bodies):
            if body.joint:
                local = covers[k][:, :3] @ body.placement.rotation.T + body.placement.translation
                pose = frames[:, body.joint]
                placed[k] = local @ pose[:, :3, :3].transpose(0, 2, 1) + pose[:, None, :3, 3], covers[k][:, 3] + grow
        found = np.zeros((len(Q), len(self.pairs)), dtype=bool)
        for number, pair in enumerate(self.pairs):
            carried = [k for k in pair if k in placed]
            if len(carried) == 2:
                (points, radii), (others, reaches) = placed[pair[0]], placed[pair[1]]
                for point, radius in zip(points.transpose(1, 0, 2), radii, strict=True):
                    gaps = np.linalg.norm(others - point[:, None], axis=2)
                    found[:, number] |= (gaps < radius + reaches).any(axis=1)
            elif carried:
                still = pair[0] + pair[1] - carried[0]
                points, radii = placed[carried[0]]
                found[:, number] = overlaps(self.bodies[still], covers[still], points, radii, inner).any(axis=1)
        return found


def overlaps(body, spheres, points, radii, inner):
    """Which balls meet a body that stands still. Shape of ``points`` without its last axis."""
    local = (points - body.placement.translation) @ body.placement.rotation
    solid = body.geometry
    met = np.zeros(points.shape[:-1], dtype=bool)
    if not isinstance(solid, coal.BVHModelBase):
        gap = distance(solid, local)
        if isinstance(solid, coal.ConvexBase):  # its upright bounding box counts as six more faces
            corners = solid.points() @ body.placement.rotation.T + body.placement.translation
            beside = np.maximum(corners.min(axis=0) - points, points - corners.max(axis=0))
            gap = np.maximum(gap, beside.max(axis=-1))
        met = gap < 0.0 if inner and isinstance(solid, coal.ConvexBase) else gap < radii
    if isinstance(solid, coal.BVHModelBase) or (inner and isinstance(solid, coal.ConvexBase)):
        for x, y, z, r in spheres:
            met |= np.linalg.norm(local - (x, y, z), axis=-1) < radii + r
    return met


def distance(solid, points):
    """Distance from a solid, 0 inside; of a convex solid and a half-space the largest height over a face."""
    if isinstance(solid, coal.Halfspace):
        return points @ solid.n - solid.d
    if isinstance(solid, coal.ConvexBase):
        faces = ConvexHull(np.array(solid.points())).equations
        return np.max([points @ face[:3] + face[3] for face in faces], axis=0)
    if isinstance(solid, coal.Box):
        return np.linalg.norm(np.maximum(np.abs(points) - solid.halfSide, 0.0), axis=-1)
    if isinstance(solid, coal.Sphere):
        return np.maximum(np.linalg.norm(points, axis=-1) - solid.radius, 0.0)
    across, beyond = np.linalg.norm(points[..., :2], axis=-1), np.abs(points[..., 2]) - solid.halfLength
    if isinstance(solid, coal.Capsule):
        return np.maximum(np.hypot(across, np.maximum(beyond, 0.0)) - solid.radius, 0.0)
    return np.hypot(np.maximum(across - solid.radius, 0.0), np.maximum(beyond, 0.0))


def kernel_frames(robot, V):
    """Joint frames that the kernels compute, shape (m, joints + 1, 4, 4)."""
    body = Body("end", len(robot.chain.parent), pin.SE3.Identity(), coal.Sphere(0.1), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.1), "obstacle")
    spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
    world = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=spheres, inner=spheres)
    turns = tables.axis_turns(robot.chain)
    found = np.tile(np.eye(4), (len(V), len(turns) + 1, 1, 1))
    for start in range(0, len(V), WIDTH):
        block = V[start : start + WIDTH]
        values = np.zeros((len(turns) + 1, WIDTH))
        values[:-1, : len(block)] = block.T
        world._scratch.values[:] = values.ravel()
        kernels.forward_kinematics(world._arm.arm, world._scratch)
        frames = world._scratch.frames.reshape(-1, 12, WIDTH).transpose(2, 0, 1)[: len(block)]
        found[start : start + WIDTH, :, :3, :3] = frames[..., :9].reshape(len(block), -1, 3, 3)
        found[start : start + WIDTH, :, :3, 3] = frames[..., 9:]
    found[:, 1:, :3, :3] = found[:, 1:, :3, :3] @ turns.transpose(0, 2, 1)
    return found
