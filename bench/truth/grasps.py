"""Picks and places from and onto tables, judged by pinocchio and coal with no pair allowed.

Random things stand exactly on random tables and are set down on another one, or up to 0.8 mm inside it. Nobody says
what may touch. The judge places the links, the thing and the tables from the shapes of the case, at closely spaced
places of every motion, and asks coal how deep they overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.judge import distance
from bench.shared.parts import Parts
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.tasks.stages import Stage

ARMS = ("ur5", "panda", "ur10", "xarm7", "kinova")
CASES, AT_ONCE = 200, 5
SECONDS = 3.0
TRIES = 40  # of a case, until an arm reaches both places
LIFT = 0.06  # [m]
OVER = 0.014  # [m] of the tip over what it takes: a hand's fingers reach beyond it
STEP = 4e-4  # [rad] or [m] between places of a motion that the judge looks at
PARTED = 1e-4  # [m]
DEEPER = 1e-3 + 1e-5  # [m] that a thing may be deeper than it was, and coal's rounding
TOUCH = 1e-6  # [m] of overlap that is none: coal tells no less
FAR = np.inf


@dataclass(frozen=True)
class Carried:
    """One pick and place: what the judge saw; depths [m] are positive where two overlap.

    Attributes:
        arm: Name of the robot.
        number: Of the case.
        found: Whether it was planned.
        proven: Whether every motion is proven.
        before: Depth at the moment of attaching.
        lifted: Greatest depth from then until the thing and the tables have parted.
        between: Greatest depth from there up to the last motion before it is let go.
        lowered: Greatest depth on that motion.
        left: Depth where it was let go.
        links: Greatest depth of a moving link in a table or in the thing while that stands.
        named: Whether the notes name each contact that the judge saw.
        reason: Why it was not planned.
    """

    arm: str
    number: int
    found: bool
    proven: bool = False
    before: float = 0.0
    lifted: float = 0.0
    between: float = 0.0
    lowered: float = 0.0
    left: float = 0.0
    links: float = 0.0
    named: bool = False
    reason: str = ""

    def wrong(self) -> list[str]:
        """The rules that it does not keep."""
        rules = {
            "deeper than it was by more than 1 mm": self.lifted > max(self.before, 0.0) + DEEPER,
            "touches between parting and setting down": self.between > TOUCH,
            "deeper than 1 mm while it is set down": self.lowered > DEEPER,
            "left deeper than 1 mm": self.left > DEEPER,
            "a link in a table or a thing": self.links > DEEPER,
            "not proven": not self.proven,
            "a contact that no note names": not self.named,
        }
        return [f"{self.arm} {self.number}: {rule}" for rule, broken in rules.items() if broken]


def _thing(rng: np.random.Generator) -> tuple[Shape, coal.CollisionGeometry, float]:
    """A thing, coal's solid of it, and how high its middle stands [m]."""
    a, b, c = rng.uniform(0.02, 0.06, 3)
    tall = float(rng.uniform(0.04, 0.12))
    kind = rng.choice(["box", "cylinder", "ball", "capsule"])
    if kind == "box":
        return rrtik.Box([a, b, tall]), coal.Box(a, b, tall), 0.5 * tall
    if kind == "cylinder":
        return rrtik.Cylinder(c, tall), coal.Cylinder(c, tall), 0.5 * tall
    if kind == "ball":
        return rrtik.Sphere(c), coal.Sphere(c), c
    return rrtik.Capsule(0.5 * c, tall), coal.Capsule(0.5 * c, tall), 0.5 * tall + 0.5 * c


def _table(rng: np.random.Generator, top: Vector) -> tuple[Shape, coal.CollisionGeometry, pin.SE3]:
    """A table whose top has a point, and coal's solid of it."""
    wide, deep, thick = rng.uniform(0.15, 0.3), rng.uniform(0.15, 0.3), rng.uniform(0.02, 0.06)
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, rng.uniform(-np.pi, np.pi))
    place = pin.SE3(turn, top - np.array([0.0, 0.0, 0.5 * thick]))
    if rng.uniform() < 0.3:
        return rrtik.Cylinder(0.5 * wide, thick), coal.Cylinder(0.5 * wide, thick), place
    return rrtik.Box([wide, deep, thick]), coal.Box(wide, deep, thick), place


@dataclass(frozen=True)
class Case:
    """Two tables, a thing on the first one, and where it goes."""

    scene: rrtik.Scene
    solids: tuple[tuple[coal.CollisionGeometry, pin.SE3], ...]
    thing: coal.CollisionGeometry
    goal: pin.SE3
    above: tuple[pin.SE3, ...]
    deeper: float


def _case(robot: rrtik.Robot, rng: np.random.Generator) -> Case:
    reach = float(
        np.linalg.norm(robot.fk_batch(rng.uniform(*robot.finite_range(), (256, robot.dof)))[:, :3, 3], axis=1).max()
    )
    shape, solid, height = _thing(rng)
    grip = np.array([0.0, 0.0, height + OVER])  # the tip over the thing's middle
    down = pin.rpy.rpyToMatrix(np.pi, 0.0, rng.uniform(-np.pi, np.pi))
    tops = []
    for side in (-1.0, 1.0):
        angle = side * rng.uniform(0.25, 0.9)
        far = reach * rng.uniform(0.35, 0.5)
        tops.append(np.array([far * np.cos(angle), far * np.sin(angle), reach * rng.uniform(0.0, 0.15)]))
    middles = [top + np.array([0.0, 0.0, height]) for top in tops]
    tables = [_table(rng, top) for top in tops]
    obstacles = [rrtik.Obstacle(f"table {k + 1}", kind, place) for k, (kind, _, place) in enumerate(tables)]
    thing = rrtik.Obstacle("thing", shape, middles[0])
    return Case(
        scene=rrtik.Scene((*obstacles, thing)),
        solids=tuple((table, place) for _, table, place in tables),
        thing=solid,
        goal=pin.SE3(np.eye(3), middles[1]),
        above=tuple(pin.SE3(down, middle + grip + np.array([0.0, 0.0, LIFT])) for middle in middles),
        deeper=float(rng.choice([0.0, rng.uniform(0.0, 8e-4)])),
    )


def carried(first: int, count: int) -> list[Carried]:
    """Cases from a number on."""
    return [_carried(number) for number in range(first, first + count)]


def _carried(number: int) -> Carried:
    arm = ARMS[number % len(ARMS)]
    robot = rrtik.load_robot(arm)
    rng = np.random.default_rng([42, number])
    reason = ""
    for _ in range(TRIES):
        case = _case(robot, rng)
        world = rrtik.World(robot, case.scene)
        start = robot.clamp(rng.uniform(*robot.finite_range()))
        if not world.valid(start):
            continue
        way = np.array([0.0, 0.0, LIFT])
        stages: list[Stage] = [
            rrtik.MoveTo(case.above[0]),
            rrtik.Straight(by=-way),
            rrtik.Attach("thing", robot.tip if robot.tip in robot.link_names else robot.link_names[-1]),
            rrtik.Straight(by=way),
            rrtik.MoveTo(case.above[1]),
            rrtik.Straight(by=-way - [0.0, 0.0, case.deeper]),
            rrtik.Detach("thing"),
            rrtik.Straight(by=way),
        ]
        plan = rrtik.Task(stages).plan(world, start, seconds=SECONDS, seed=number)
        if plan.found:
            return _judged(arm, number, case, plan)
        reason = plan.reason
    return Carried(arm, number, False, reason=reason)


def _judged(arm: str, number: int, case: Case, plan: rrtik.TaskPlan) -> Carried:
    """What the judge sees of a plan: motions 1 and 2 without the thing, 3 to 5 with it, 6 without."""
    robot, item = plan.worlds[2].robot, plan.worlds[2].scene.attached[0]
    judge = Judge(robot, case)
    lift, carry, lower = (judge.held(path, item.link, item.pose) for path in plan.paths[2:5])
    parted = int(np.flatnonzero(lift < -PARTED)[0]) if (lift < -PARTED).any() else len(lift)
    places = [path.waypoints for path in plan.paths]
    standing = (case.scene.obstacle("thing").pose, judge.place(places[4][-1], item.link) * item.pose)
    links = [judge.links(path, standing[0]) for path in plan.paths[:2]]
    links += [judge.links(path, None) for path in plan.paths[2:5]] + [judge.links(plan.paths[5], standing[1])]
    seen = {3: lift.max() > -TOUCH, 5: lower.max() > TOUCH}
    notes = " ".join(plan.notes)
    named = all(f"stage {stage}" in notes for stage, touched in ((4, seen[3]), (6, seen[5])) if touched)
    between = max(float(lift[parted:].max(initial=-FAR)), float(carry.max()))
    return Carried(
        arm,
        number,
        True,
        proven=bool(plan.proven) and not plan.violations(),
        before=float(lift[0]),
        lifted=float(lift[: parted + 1].max()),
        between=between,
        lowered=float(lower.max()),
        left=float(lower[-1]),
        links=max(links),
        named=named,
    )


class Judge:
    """Depths by pinocchio and coal.

    Args:
        robot: Its model and the geometries of its links are read.
        case: Tables and thing.
    """

    def __init__(self, robot: rrtik.Robot, case: Case) -> None:
        self._robot, self._model, self._case = robot, robot.model, case
        self._data = robot.model.createData()
        items = robot.collision.geometryObjects
        self._links = [(o.parentJoint, o.placement, o.geometry) for o in items if o.parentJoint > 0]

    def place(self, q: Vector, link: str) -> pin.SE3:
        """The pose of a link's frame."""
        self._at(self._robot.pinocchio_configuration(q[None])[0])
        return self._data.oMf[self._model.getFrameId(link)].copy()

    def _at(self, full: Vector) -> None:
        pin.forwardKinematics(self._model, self._data, full)
        pin.updateFramePlacements(self._model, self._data)

    def _rows(self, path: rrtik.JointPath, step: float) -> Matrix:
        found: Matrix = self._robot.pinocchio_configuration(path.resample(step).waypoints)
        return found

    def held(self, path: rrtik.JointPath, link: str, grasp: pin.SE3) -> Vector:
        """Depth of the held thing in the tables along a motion [m], negative where they are apart."""
        frame, found = self._model.getFrameId(link), []
        for full in self._rows(path, STEP):
            self._at(full)
            pose = self._data.oMf[frame] * grasp
            found.append(max(-distance(self._case.thing, pose, solid, place) for solid, place in self._case.solids))
        return np.array(found)

    def links(self, path: rrtik.JointPath, thing: pin.SE3 | None) -> float:
        """Greatest depth of a link in the tables, and in the thing where it stands, along a motion [m]."""
        others = [*self._case.solids, *([] if thing is None else [(self._case.thing, thing)])]
        deepest = -FAR
        for full in self._rows(path, 25.0 * STEP):
            self._at(full)
            for joint, placement, geometry in self._links:
                pose = self._data.oMi[joint] * placement
                deepest = max(deepest, *(-distance(geometry, pose, solid, place) for solid, place in others))
        return deepest


def section(parts: Parts, size: float) -> Report:
    """Picks and places, and what the judge saw of them."""
    count = max(1, round(CASES * size))
    batches = [(first, min(AT_ONCE, count - first)) for first in range(0, count, AT_ONCE)]
    found: list[Carried] = [each for batch in parts(carried, batches) for each in batch]
    report = Report("", "")
    planned = [each for each in found if each.found]
    wrong = [text for each in planned for text in each.wrong()]
    report.bar(
        f"{count} picks and places from and onto tables, judged by coal with no pair allowed",
        "depth at most as at the start and 1 mm; 0 between parting and the last motion; there 1 mm at most",
        f"{len(wrong)} otherwise of {len(planned)}, {count - len(planned)} not planned",
        not wrong and len(planned) >= 0.9 * count,
    )
    report.table(
        "Picks and places",
        ["arm", "planned", "before", "while in contact", "between", "while set down", "left", "links"],
        [[arm, *_row([each for each in planned if each.arm == arm], found, arm)] for arm in ARMS],
        text="Greatest depths [mm], negative: least gaps. "
        + ("" if not wrong else "\n" + "\n".join(f"- {each}" for each in wrong)),
    )
    return report


def _row(planned: Sequence[Carried], found: Sequence[Carried], arm: str) -> list[str]:
    names = ("before", "lifted", "between", "lowered", "left", "links")
    worst = [f"{1e3 * max(getattr(each, name) for each in planned):.3f}" if planned else "" for name in names]
    return [f"{len(planned)} of {sum(each.arm == arm for each in found)}", *worst]
