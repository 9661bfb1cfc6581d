"""Robots from files: the arm that was asked for, and all of its pairs, limits and faults, beside other programs.

Random URDFs are judged by Pinocchio's own parser and coal, random MJCFs by MuJoCo; neither shares a line with what
reads them here. What is known to have been wrong once is a list of small files.
"""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

from bench.shared.judge import distance
from bench.shared.parts import Parts
from bench.truth.robot_files import CASES, MENTIONED, misspelt, mjcf_arm, srdf_of, urdf_arm
from rrtik_bench.report.page import Report
from rrtik_ompl import InputError, Robot, World, load_robot
from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.base.errors import DescriptionWarning

ARMS, BATCH, POSTURES = 400, 20, 200
FAULTS = 1000
NEAR = 1e-6  # [m] of touching, where programs may differ
LEGAL = 2e-5  # [rad or m] beside a limit, which has a tolerance


@dataclass(frozen=True)
class Judged:
    """What a judge found.

    Attributes:
        postures: That were compared.
        touching: Of them, by the judge.
        missed, extra: Postures that are free or in collision here alone.
        worst: Difference of poses [m, or of a number of a rotation matrix].
        passed: Values of joints, within the limits of the robot, that are outside their own.
        cut: Values that would be within all limits and are refused.
        named: Robots of which solids that always touch were named; they are not compared.
        refused: Robots refused, as no value keeps a follower within its limits.
        wrong: Anything else that is wrong.
    """

    postures: int = 0
    touching: int = 0
    missed: int = 0
    extra: int = 0
    worst: float = 0.0
    passed: int = 0
    cut: int = 0
    named: int = 0
    refused: int = 0
    wrong: list[str] = field(default_factory=list)


def urdfs(first: int, count: int) -> list[Judged]:
    """Random URDFs, half of them with an SRDF, beside Pinocchio and coal."""
    return [_urdf(seed) for seed in range(first, first + count)]


def mjcfs(first: int, count: int) -> list[Judged]:
    """Random MJCFs beside MuJoCo."""
    return [_mjcf(seed) for seed in range(first, first + count)]


def misspelt_srdfs(first: int, count: int) -> list[str]:
    """SRDFs with a wrong letter in one name of a link, joint or group: those of which nothing is said."""
    silent = []
    for seed in range(first, first + count):
        rng = np.random.default_rng([seed, 3])
        with TemporaryDirectory() as folder:
            file, srdf = Path(folder) / "arm.urdf", Path(folder) / "arm.srdf"
            file.write_text(MENTIONED.urdf)
            text, line = misspelt(MENTIONED.srdf, rng)
            srdf.write_text(text)
            said = _said(partial(load_robot, file, srdf=srdf))[1]
            if not any(f"arm.srdf:{line}: " in each for each in said):
                silent.append(f"{seed}: line {line}")
            try:
                load_robot(file, srdf=srdf, strict=True)
                silent.append(f"{seed}: line {line}, strict")
            except InputError:
                pass
    return silent


def small_cases() -> list[tuple[str, str]]:
    """Small files of which another robot was made once, or a wrong answer given: name, and what is wrong now."""
    found = []
    for name, judge in CASES.items():
        with TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                wrong = judge(Path(folder), caught)
            except Exception as error:  # which is a fault of the product as well
                wrong = f"{type(error).__name__}: {error}"
        found.append((name, wrong))
    return found


def section(parts: Parts, size: float) -> Report:
    """Judge robots from files."""
    arms = max(BATCH, int(size * ARMS))
    batches = [(first, BATCH) for first in range(0, arms, BATCH)]
    by = {
        "URDF beside Pinocchio and coal": [each for part in parts(urdfs, batches) for each in part],
        "MJCF beside MuJoCo": [each for part in parts(mjcfs, batches) for each in part],
    }
    faults = max(BATCH, int(size * FAULTS))
    silent = [each for part in parts(misspelt_srdfs, [(k, BATCH) for k in range(0, faults, BATCH)]) for each in part]
    cases = parts(small_cases, [()])[0]
    report = Report("Robots from files", "")
    rows = []
    for name, found in by.items():
        total = {key: sum(getattr(each, key) for each in found) for key in SUMS}
        worst = max(each.worst for each in found)
        wrong = [line for each in found for line in each.wrong]
        report.bar(f"{name}: postures that touch and are called free", "0", f"{total['missed']}", total["missed"] == 0)
        report.bar(f"{name}: free postures called touching", "0", f"{total['extra']}", total["extra"] == 0)
        report.bar(f"{name}: worst difference of poses", "below 1e-9", f"{worst:.1e}", worst < 1e-9)
        report.bar(
            f"{name}: values outside a joint's or follower's own limits that are allowed, values inside that are not",
            "0, 0",
            f"{total['passed']}, {total['cut']}",
            total["passed"] == total["cut"] == 0,
        )
        report.bar(f"{name}: anything else", "0", f"{len(wrong)} {'; '.join(wrong[:2])}".strip(), not wrong)
        rows.append((name, str(len(found)), *(str(total[key]) for key in SUMS if key not in HIDDEN)))
    report.bar(f"{faults} SRDFs with one misspelt name: silent, or taken by strict", "0", f"{len(silent)}", not silent)
    bad = [f"{name}: {wrong}" for name, wrong in cases if wrong]
    report.bar(
        "small files that once gave another robot or a wrong answer", "0 wrong", f"{len(bad)} of {len(cases)}", not bad
    )
    report.table(
        "Robots from files",
        ("judge", "robots", "postures", "touching", "named: solids that always touch", "refused: no value is legal"),
        rows,
        text="Random trees of joints with followers (of followers), links without solids, fixed and several solids; "
        "with lists of pairs, masks, several joints between two bodies, free and standing bodies.",
    )
    report.table("Small files", ("file", "wrong"), [(name, wrong or "nothing") for name, wrong in cases], level=3)
    return report


SUMS = ("postures", "touching", "missed", "extra", "passed", "cut", "named", "refused")
HIDDEN = ("missed", "extra", "passed", "cut")


def _said(call: Callable[[], Any]) -> tuple[Any, list[str]]:
    """What a call returns, and the descriptions' warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call()
    return result, [str(each.message) for each in caught if each.category is DescriptionWarning]


def _urdf(seed: int) -> Judged:
    rng = np.random.default_rng([seed, 1])
    text = urdf_arm(rng)
    judge = _UrdfJudge(text)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "arm.urdf"
        file.write_text(text)
        options: dict[str, Any] = {}
        if seed % 2:
            content = srdf_of(rng, judge.links)
            options["srdf"] = Path(folder) / "arm.srdf"
            options["srdf"].write_text(content)
            judge.read_srdf(content)
        return _judged(seed, rng, judge, lambda: load_robot(file, **options))


def _contacts(world: World, Q: Any, depth: Callable[[Robot, Any], float]) -> dict[str, int]:
    """Counts of a comparison of postures; ``depth`` is how deep anything is in another [m], negative if nothing is."""
    free = world.valid_batch(Q)
    deep = np.array([depth(world.robot, q) for q in Q])
    return {
        "postures": len(Q),
        "touching": int((deep > 0.0).sum()),
        "missed": int((free & (deep > NEAR)).sum()),
        "extra": int((~free & (deep < -NEAR)).sum()),
    }


def _joined(root: ElementTree.Element) -> set[frozenset[str]]:
    """Pairs of links of a URDF that one joint joins, where frames without solids are part of the link beside them."""
    solid = {link.get("name", "") for link in root.findall("link") if link.find("collision") is not None}
    ends = {
        (joint.find("parent").get("link"), joint.find("child").get("link")): joint.get("type") == "fixed"  # type: ignore[union-attr]
        for joint in root.findall("joint")
    }

    def beside(link: Any, seen: frozenset[Any]) -> set[Any]:
        if link in solid:
            return {link}
        near = {other for pair, fixed in ends.items() if fixed and link in pair for other in pair} - seen
        return {each for other in near for each in beside(other, seen | near)}

    both = [(beside(a, frozenset((a,))), beside(b, frozenset((b,)))) for (a, b), fixed in ends.items() if not fixed]
    return {frozenset(one | other) for one, other in both if len(one) == len(other) == 1}


class _UrdfJudge:
    """A URDF as Pinocchio reads it; who follows whom is read here."""

    def __init__(self, text: str) -> None:
        self.model = pin.buildModelFromXML(text)
        self.solids = pin.buildGeomFromUrdfString(self.model, text, pin.GeometryType.COLLISION)
        self._data = self.model.createData()
        root = ElementTree.fromstring(text)
        self.links = [link.get("name", "") for link in root.findall("link")]
        self.ties: dict[str, tuple[str, float, float]] = {}
        for joint in root.findall("joint"):
            tie = joint.find("mimic")
            if tie is not None:
                gain, offset = (float(tie.get(key, "0")) for key in ("multiplier", "offset"))
                self.ties[joint.get("name", "")] = (tie.get("joint", ""), gain, offset)
        self.leaders = [name for name in list(self.model.names)[1:] if name not in self.ties]
        self.joined = _joined(root)
        self.apart: set[frozenset[str]] = set()
        self.asked: set[frozenset[str]] = set()

    def read_srdf(self, content: str) -> None:
        """Take over which pairs are compared and which are not."""
        for tag, pairs in (("disable_collisions", self.apart), ("enable_collisions", self.asked)):
            for item in ElementTree.fromstring(content).findall(tag):
                pairs.add(frozenset((item.get("link1", ""), item.get("link2", ""))))

    def value(self, joint: str, values: Mapping[str, float]) -> float:
        """Of a joint, where those that follow nothing have values."""
        if joint not in self.ties:
            return values[joint]
        source, gain, offset = self.ties[joint]
        return gain * self.value(source, values) + offset

    def legal(self, values: Mapping[str, float], slack: float) -> bool:
        """Whether all joints are within their own limits, which are that much wider."""
        return all(low - slack <= value <= high + slack for value, low, high in self._limits(values))

    def any_legal(self) -> bool:
        """Whether each joint that others follow has a legal value, of many."""
        for leader in self.leaders:
            low, high = self._range(leader)
            rest = {other: 0.0 for other in self.leaders}
            own = {leader, *(name for name in self.ties if self._root(name) == leader)}
            values = np.linspace(low, high, 4001)
            if not any(self._legal_of(own, {**rest, leader: float(value)}) for value in values):
                return False
        return True

    def limits(self, robot: Robot, rng: np.random.Generator) -> tuple[int, int]:
        """Allowed values that some joint's own limits forbid, and forbidden ones that all of them allow."""
        passed = cut = 0
        for _ in range(POSTURES):
            values = {name: float(rng.uniform(*self._range(name))) for name in self.leaders}
            allowed = bool(robot.within_limits([[values[name] for name in robot.joint_names]], 0.0)[0])
            passed += allowed and not self.legal(values, LEGAL)
            cut += not allowed and self.legal(values, -LEGAL)
        return passed, cut

    def difference(self, robot: Robot, q: Any) -> float:
        """The largest difference of the links' poses."""
        self._place(robot, q)
        poses = (
            (self._data.oMf[self.model.getFrameId(link)].homogeneous, robot.fk(q, link).homogeneous)
            for link in self.links
        )
        return max(float(np.abs(one - other).max()) for one, other in poses)

    def depth(self, robot: Robot, q: Any) -> float:
        """How deep the solids of a compared pair are in each other [m]; negative: how far apart all are."""
        self._place(robot, q)
        deepest = -np.inf
        for a, b in self._pairs():
            poses = [self._data.oMi[each.parentJoint] * each.placement for each in (a, b)]
            deepest = max(deepest, -distance(a.geometry, poses[0], b.geometry, poses[1]))
        return deepest

    def _pairs(self) -> Iterator[tuple[Any, Any]]:
        for a, b in combinations(self.solids.geometryObjects, 2):
            names = frozenset(self.model.frames[each.parentFrame].name for each in (a, b))
            near = names in self.joined and names not in self.asked
            if a.parentJoint != b.parentJoint and names not in self.apart and not near:
                yield a, b

    def _place(self, robot: Robot, q: Any) -> None:
        values = dict(zip(robot.joint_names, map(float, q), strict=True))
        full = pin.neutral(self.model)
        for number, name in enumerate(self.model.names):
            if number:
                at, value = self.model.idx_qs[number], self.value(name, values)
                full[at : at + self.model.nqs[number]] = (
                    [value] if self.model.nqs[number] == 1 else [np.cos(value), np.sin(value)]
                )
        pin.framesForwardKinematics(self.model, self._data, full)

    def _root(self, joint: str) -> str:
        return self._root(self.ties[joint][0]) if joint in self.ties else joint

    def _range(self, joint: str) -> tuple[float, float]:
        """Limits of a joint by Pinocchio; one turn where there are none."""
        number = self.model.getJointId(joint)
        if self.model.nqs[number] != 1:
            return -np.pi, np.pi
        at = self.model.idx_qs[number]
        return float(self.model.lowerPositionLimit[at]), float(self.model.upperPositionLimit[at])

    def _limits(self, values: Mapping[str, float]) -> Iterator[tuple[float, float, float]]:
        for number, name in enumerate(self.model.names):
            if number and self.model.nqs[number] == 1:
                yield self.value(name, values), *self._range(name)

    def _legal_of(self, joints: set[str], values: Mapping[str, float]) -> bool:
        single = [name for name in joints if self.model.nqs[self.model.getJointId(name)] == 1]
        return all(self._range(name)[0] <= self.value(name, values) <= self._range(name)[1] for name in single)


class _MjcfJudge:
    """An MJCF as MuJoCo reads it."""

    def __init__(self, text: str) -> None:
        import mujoco  # which nothing else of this report needs

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)

    def depth(self, robot: Robot, q: Any) -> float:
        """How deep two geoms are in each other [m]; minus infinity where MuJoCo finds no contact."""
        self._place(robot.joint_names, q)
        return max((-float(contact.dist) for contact in self._data.contact), default=-np.inf)

    def difference(self, robot: Robot, q: Any) -> float:
        """The largest difference of the bodies' poses."""
        self._place(robot.joint_names, q)
        found = 0.0
        for body in range(1, self._model.nbody):
            pose = robot.fk(q, self._model.body(body).name)
            found = max(found, float(np.abs(pose.translation - self._data.xpos[body]).max()))
            found = max(found, float(np.abs(pose.rotation - self._data.xmat[body].reshape(3, 3)).max()))
        return found

    def limits(self, robot: Robot, rng: np.random.Generator) -> tuple[int, int]:
        """Allowed postures that some joint's own limits forbid, and forbidden ones that all of them allow.

        Joints that turn without end have whole turns for limits, if others follow them at a fraction: none beyond.
        """
        passed = cut = 0
        turns = robot.upper == np.rint(robot.upper / TAU) * TAU
        for q in np.where(turns, 1.0, 1.3) * rng.uniform(*robot.finite_range(), (POSTURES, robot.dof)):
            self._place(robot.joint_names, q)
            allowed = bool(robot.within_limits([q], 0.0)[0])
            passed += allowed and not self._legal(LEGAL)
            cut += not allowed and self._legal(-LEGAL)
        return passed, cut

    def any_legal(self) -> bool:
        """Whether a value of what is followed is within its range and that of the follower."""
        model = self._model
        leader, follower = int(model.eq_obj2id[0]), int(model.eq_obj1id[0])
        low, high = model.jnt_range[leader] if model.jnt_limited[leader] else (-np.pi, np.pi)
        for value in np.linspace(low, high, 4001):
            self._place([model.joint(leader).name], [float(value)])
            if all(self._joint_legal(joint, 0.0) for joint in (leader, follower)):
                return True
        return False

    def _place(self, joints: Sequence[str], q: Sequence[float]) -> None:
        model, data = self._model, self._data
        self._mujoco.mj_resetData(model, data)
        for name, value in zip(joints, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        for number in range(model.neq):  # y - y0 = a0 + a1 (x - x0)
            one, other = (model.jnt_qposadr[each[number]] for each in (model.eq_obj1id, model.eq_obj2id))
            a0, a1 = model.eq_data[number][:2]
            data.qpos[one] = model.qpos0[one] + a0 + a1 * (data.qpos[other] - model.qpos0[other])
        self._mujoco.mj_forward(model, data)

    def _legal(self, slack: float) -> bool:
        return all(self._joint_legal(number, slack) for number in range(self._model.njnt))

    def _joint_legal(self, number: int, slack: float) -> bool:
        low, high = self._model.jnt_range[number]
        value = self._data.qpos[self._model.jnt_qposadr[number]]
        return bool(not self._model.jnt_limited[number] or low - slack <= value <= high + slack)


def _mjcf(seed: int) -> Judged:
    rng = np.random.default_rng([seed, 2])
    text = mjcf_arm(rng)
    judge = _MjcfJudge(text)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "arm.xml"
        file.write_text(text)
        return _judged(seed, rng, judge, lambda: load_robot(file))


def _judged(seed: int, rng: np.random.Generator, judge: _UrdfJudge | _MjcfJudge, load: Callable[[], Robot]) -> Judged:
    """A robot beside its judge."""
    try:
        robot: Robot = _said(load)[0]
    except InputError as error:
        right = "no value of joint" in str(error) and not judge.any_legal()
        return Judged(refused=1, wrong=[] if right else [f"{seed}: {error}"])
    world, named = _said(partial(World, robot))
    low, high = robot.finite_range()
    Q = rng.uniform(low, high, (POSTURES, robot.dof))
    passed, cut = judge.limits(robot, rng)
    worst = max(judge.difference(robot, q) for q in Q[:20])
    counts: dict[str, Any] = {"named": 1} if named else _contacts(world, Q, judge.depth)
    return Judged(worst=worst, passed=passed, cut=cut, **counts)
