"""Files of robots for the judges: random ones, one to misspell, and those of which another robot was made once."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rrtik_ompl import InputError, Robot, World, load_robot

Case = Callable[[Path, list[warnings.WarningMessage]], str]


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def _limits(rng: np.random.Generator) -> tuple[float, float]:
    low, high = sorted(rng.uniform(-2.5, 2.5, 2))
    return float(low), float(high) + 0.2


def urdf_arm(rng: np.random.Generator) -> str:
    """A tree of joints with followers, of links with no solid, one or several, some of them rigidly joined."""
    count = int(rng.integers(3, 9))
    links, joints, movable = [_urdf_link(rng, 0)], [], list[str]()
    for k in range(1, count + 1):
        links.append(_urdf_link(rng, k))
        parent = k - 1 if rng.random() < 0.8 else int(rng.integers(0, k))
        kind = str(rng.choice(["revolute", "continuous", "prismatic", "fixed"], p=[0.6, 0.1, 0.15, 0.15]))
        kind = "revolute" if k == 1 else kind
        parts = [
            f'<parent link="l{parent}"/><child link="l{k}"/>',
            f'<origin xyz="{_numbers(rng.normal(0.0, 0.2, 3))}" rpy="{_numbers(rng.uniform(-1.5, 1.5, 3))}"/>',
            f'<axis xyz="{_numbers(rng.normal(size=3))}"/>',
        ]
        low, high = _limits(rng)
        scale = 0.1 if kind == "prismatic" else 1.0
        if kind != "fixed":
            parts.append(f'<limit lower="{scale * low:.6g}" upper="{scale * high:.6g}" velocity="1" effort="1"/>')
            if movable and rng.random() < 0.3:
                gain = rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 1.5) * scale
                offset = rng.normal(0.0, 0.3) * scale
                source = str(rng.choice(movable))
                parts.append(f'<mimic joint="{source}" multiplier="{gain:.6g}" offset="{offset:.6g}"/>')
            if kind == "revolute":  # a slide that follows what turns without end is refused
                movable.append(f"j{k}")
        joints.append(f'<joint name="j{k}" type="{kind}">{"".join(parts)}</joint>')
    return f'<robot name="arm">{"".join(links + joints)}</robot>'


def _urdf_link(rng: np.random.Generator, number: int) -> str:
    solids = []
    for _ in range(int(rng.choice([0, 1, 2], p=[0.4, 0.4, 0.2]))):
        size = rng.uniform(0.02, 0.08, 3)
        shape = [
            f'<sphere radius="{size[0]:.6g}"/>',
            f'<box size="{_numbers(size)}"/>',
            f'<cylinder radius="{size[0]:.6g}" length="{4.0 * size[1]:.6g}"/>',
        ][int(rng.integers(3))]
        place = f'<origin xyz="{_numbers(rng.normal(0.0, 0.08, 3))}" rpy="{_numbers(rng.uniform(-1.5, 1.5, 3))}"/>'
        solids.append(f"<collision>{place}<geometry>{shape}</geometry></collision>")
    return f'<link name="l{number}">{"".join(solids)}</link>'


def srdf_of(rng: np.random.Generator, links: Sequence[str]) -> str:
    """An SRDF with a few pairs that are not compared, and a few that are."""
    found = []
    for tag in ("disable_collisions", "enable_collisions"):
        for _ in range(int(rng.integers(1, 4))):
            one, other = rng.choice(links, 2, replace=False)
            found.append(f'<{tag} link1="{one}" link2="{other}"/>')
    return f'<robot name="arm">{"".join(found)}</robot>'


def mjcf_arm(rng: np.random.Generator) -> str:
    """A tree of bodies with masks, none to two joints each, followers, excluded pairs, free and standing ones."""
    count = int(rng.integers(3, 8))
    inside: dict[int, list[int]] = {k: [] for k in range(count + 1)}
    for k in range(1, count + 1):
        inside[k - 1 if rng.random() < 0.7 else int(rng.integers(0, k))].append(k)
    hinges: list[str] = []
    bodies = _mjcf_bodies(rng, inside, 0, hinges)
    ties = ""
    if len(hinges) > 1:
        one, other = rng.choice(hinges[1:], 1)[0], hinges[0]
        ties = f'<joint joint1="{one}" joint2="{other}" polycoef="{_numbers(rng.normal(0.0, 0.4, 2))} 0 0 0"/>'
    pairs = [rng.choice(count, 2, replace=False) + 1 for _ in range(int(rng.integers(0, 3)))]
    excludes = "".join(f'<exclude body1="b{a}" body2="b{b}"/>' for a, b in pairs)
    cube = f'<body name="cube" pos="{_numbers(rng.normal(0.0, 0.5, 3))}"><freejoint/><geom size=".05"/></body>'
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{_geom(rng, 0.4)}{cube}{bodies}</worldbody>'
        f"<equality>{ties}</equality><contact>{excludes}</contact></mujoco>"
    )


def _mjcf_bodies(rng: np.random.Generator, inside: dict[int, list[int]], above: int, hinges: list[str]) -> str:
    found = []
    for k in inside[above]:
        joints = []
        for number in range(int(rng.choice([0, 1, 2], p=[0.2, 0.6, 0.2])) if k > 1 else 1):
            low, high = _limits(rng)
            slide = k > 1 and rng.random() < 0.2
            kind, scale = ("slide", 0.1) if slide else ("hinge", 1.0)
            limits = f'range="{scale * low:.6g} {scale * high:.6g}"' if slide or rng.random() < 0.8 else ""
            name = f"j{k}_{number}"
            hinges += [] if slide else [name]
            joints.append(
                f'<joint name="{name}" type="{kind}" axis="{_numbers(rng.normal(size=3))}" {limits}'
                f' pos="{_numbers(rng.normal(0.0, 0.03, 3))}" ref="{scale * rng.normal(0.0, 0.2):.6g}"/>'
            )
        geoms = "".join(_geom(rng, 0.08) for _ in range(int(rng.integers(1, 3))))
        place = f'pos="{_numbers(rng.normal(0.0, 0.2, 3))}" quat="{_numbers(rng.normal(size=4))}"'
        below = _mjcf_bodies(rng, inside, k, hinges)
        found.append(f'<body name="b{k}" {place}>{"".join(joints)}{geoms}{below}</body>')
    return "".join(found)


def _geom(rng: np.random.Generator, spread: float) -> str:
    masks = rng.integers(0, 4, 2) if rng.random() < 0.5 else (1, 1)
    place = f'pos="{_numbers(rng.normal(0.0, spread, 3))}" contype="{masks[0]}" conaffinity="{masks[1]}"'
    if rng.random() < 0.5:
        return f'<geom {place} size="{rng.uniform(0.02, 0.08):.6g}"/>'
    turn = f'quat="{_numbers(rng.normal(size=4))}"'
    return f'<geom type="capsule" {place} {turn} size="{_numbers(rng.uniform(0.02, 0.06, 2))}"/>'


@dataclass(frozen=True)
class Described:
    """A URDF and an SRDF of it."""

    urdf: str
    srdf: str


def _joint(name: str, parent: str, child: str, *, reach: str = "0.3", low: float = -2.0, high: float = 2.0) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {reach}"/><axis xyz="0 1 0"/><limit lower="{low}" upper="{high}" velocity="1" effort="1"/>'
        "</joint>"
    )


MENTIONED = Described(
    '<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>'
    + _joint("shoulder", "base", "upper")
    + _joint("elbow", "upper", "fore")
    + _joint("wrist", "fore", "hand")
    + "</robot>",
    """<robot name="arm">
<virtual_joint name="mount" type="fixed" parent_frame="world" child_link="base"/>
<group name="arm">
 <joint name="mount"/>
 <joint name="shoulder"/>
 <link name="fore"/>
 <chain base_link="base" tip_link="hand"/>
</group>
<group name="all">
 <group name="arm"/>
</group>
<group name="gripper">
 <joint name="wrist"/>
</group>
<group_state name="home" group="arm">
 <joint name="shoulder" value="0.1"/>
 <joint name="elbow" value="0.1"/>
 <joint name="wrist" value="0.1"/>
</group_state>
<end_effector name="tool" parent_link="fore" group="gripper" parent_group="arm"/>
<disable_collisions link1="base" link2="upper" reason="Adjacent"/>
<enable_collisions link1="base" link2="hand"/>
<disable_default_collisions link="hand"/>
<passive_joint name="mount"/>
</robot>""",
)
_KEYS = ("link", "link1", "link2", "base_link", "tip_link", "parent_link", "child_link", "group", "parent_group")
_REFERENCE = re.compile(
    rf' (?:{"|".join(_KEYS)})="(\w+)"|<(?:joint|link|passive_joint) name="(\w+)"|<group name="(\w+)"/'
)


def misspelt(srdf: str, rng: np.random.Generator) -> tuple[str, int]:
    """An SRDF with another letter in one name that it uses, and the line of that."""
    places = list(_REFERENCE.finditer(srdf))
    found = places[int(rng.integers(len(places)))]
    number = next(k for k in (1, 2, 3) if found[k])
    at = int(rng.integers(*found.span(number)))
    letter = "q" if srdf[at] != "q" else "x"
    return srdf[:at] + letter + srdf[at + 1 :], srdf[:at].count("\n") + 1


# Small files, each of which gave another robot or a wrong answer.

XACRO = (
    """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="long" default="false"/>
<xacro:property name="l" value="${0.9 if '$(arg long)' == 'true' else 0.3}"/>
<link name="base"/><link name="a"/><link name="b"/>"""
    + _joint("j1", "base", "a", reach="0")
    + _joint("j2", "a", "b", reach="${l}")
    + "</robot>"
)
ONE_GROUP = '<robot name="arm"><group name="arm"><chain base_link="base" tip_link="b"/></group></robot>'
TWO_GROUPS = """<robot name="arm"><group name="arm"><joint name="j1"/><joint name="j2"/></group>
<group name="gripper"><joint name="jf"/></group><end_effector name="ee" parent_link="b" group="arm"/></robot>"""


def _workspace(folder: Path, urdf: str, srdf: str, xacro_args: str = "''") -> Path:
    """A package with a description, and a configuration folder beside it."""
    config = folder / "arm_moveit_config" / "config"
    config.mkdir(parents=True)
    (config / "arm.srdf").write_text(srdf)
    (config.parent / ".setup_assistant").write_text(
        "moveit_setup_assistant_config:\n  URDF:\n    package: arm_description\n"
        f"    relative_path: urdf/arm.urdf.xacro\n    xacro_args: {xacro_args}\n"
        "  SRDF:\n    relative_path: config/arm.srdf\n"
    )
    (folder / "arm_description" / "urdf").mkdir(parents=True)
    (folder / "arm_description" / "urdf" / "arm.urdf.xacro").write_text(urdf)
    return config.parent


def _length(robot: Robot, wanted: float) -> str:
    found = float(robot.fk(np.zeros(robot.dof), "b").translation[2])
    return "" if abs(found - wanted) < 1e-12 else f"the arm is {found:g} m long, {wanted:g} m was asked for"


def _arguments(form: str) -> Case:
    def judge(folder: Path, _: list[warnings.WarningMessage]) -> str:
        config = _workspace(folder, XACRO, ONE_GROUP, form)
        return _length(load_robot(config), 0.9) or _length(load_robot(config, xacro_args={"long": "false"}), 0.3)

    return judge


def _gazebo(folder: Path, _: list[warnings.WarningMessage]) -> str:
    config = _workspace(folder, XACRO, ONE_GROUP)
    old = '<robot name="arm"><link name="base"/><link name="a"/><link name="b"/>'
    old += _joint("j1", "base", "a", reach="0") + _joint("j2", "a", "b", reach="0.1") + "</robot>"
    (config / "config" / "gazebo_arm.urdf").write_text(old)
    return _length(load_robot(config), 0.3)


def _gripper(solver: str) -> Case:
    def judge(folder: Path, _: list[warnings.WarningMessage]) -> str:
        finger = '<link name="f"/>' + _joint("jf", "b", "f") + "</robot>"
        config = _workspace(folder, XACRO.replace("</robot>", finger), TWO_GROUPS)
        (config / "config" / "kinematics.yaml").write_text(solver)
        if solver == "{}":
            return _refused(lambda: load_robot(config), "which group is the arm", "arm", "gripper")
        joints = load_robot(config).joint_names
        return "" if joints == ("j1", "j2") else f"the joints are {joints}"

    return judge


def _refused(call: Callable[[], object], *words: str) -> str:
    """What is wrong with a refusal that has to name some words."""
    try:
        found = call()
    except InputError as error:
        missing = [word for word in words if word not in str(error)]
        return f"the refusal does not say {missing}: {error}" if missing else ""
    return f"not refused: {found}"


def _warned(caught: list[warnings.WarningMessage], *words: str) -> str:
    lines = [str(each.message) for each in caught]
    return "" if any(all(word in line for word in words) for line in lines) else f"no warning of {words}: {lines}"


def _mimic(gain: float, offset: float, limits: tuple[float, float], wanted: tuple[float, float] | None) -> Case:
    def judge(folder: Path, _: list[warnings.WarningMessage]) -> str:
        tie = f'<mimic joint="a" multiplier="{gain}" offset="{offset}"/></joint>'
        follower = _joint("f", "u", "v", low=limits[0], high=limits[1]).replace("</joint>", tie)
        text = '<robot name="m"><link name="base"/><link name="u"/><link name="v"/>'
        (folder / "m.urdf").write_text(text + _joint("a", "base", "u") + follower + "</robot>")
        if wanted is None:
            return _refused(lambda: load_robot(folder / "m.urdf"), "'a'", "'f'", "m.urdf")
        robot = load_robot(folder / "m.urdf")
        found = (float(robot.lower[0]), float(robot.upper[0]))
        return "" if np.allclose(found, wanted) else f"the leader moves in {found}, not {wanted}"

    return judge


def _srdf_fault(old: str, new: str, *words: str) -> Case:
    def judge(folder: Path, caught: list[warnings.WarningMessage]) -> str:
        (folder / "arm.urdf").write_text(MENTIONED.urdf)
        (folder / "arm.srdf").write_text(MENTIONED.srdf.replace(old, new))
        urdf, srdf = folder / "arm.urdf", folder / "arm.srdf"
        load_robot(urdf, srdf=srdf)
        return _warned(caught, *words) or _refused(lambda: load_robot(urdf, srdf=srdf, strict=True), *words)

    return judge


def _folding(srdf: str) -> Case:
    """A hand that folds back into the forearm; the link between the two is empty."""

    def judge(folder: Path, _: list[warnings.WarningMessage]) -> str:
        fore = '<collision><origin xyz="0 0 -.2"/><geometry><cylinder radius=".04" length=".4"/></geometry></collision>'
        hand = '<collision><origin xyz="0 0 .16"/><geometry><box size=".02 .02 .2"/></geometry></collision>'
        text = f'<robot name="r"><link name="base"/><link name="fore">{fore}</link><link name="w"/>'
        text += f'<link name="hand">{hand}</link>' + _joint("j1", "base", "fore") + _joint("j2", "fore", "w", reach="0")
        text += _joint("j3", "w", "hand", reach="0", low=-3.1, high=3.1) + "</robot>"
        (folder / "r.urdf").write_text(text)
        options: dict[str, Any] = {}
        if srdf:
            (folder / "r.srdf").write_text(f'<robot name="r">{srdf}</robot>')
            options["srdf"] = folder / "r.srdf"
        world = World(load_robot(folder / "r.urdf", **options))
        answers = (world.valid([0.0, 0.0, 3.1]), world.valid([0.0, 0.0, 0.0]))
        return "" if answers == (False, True) else f"folded, stretched: free {answers}"

    return judge


def _capsules(folder: Path, caught: list[warnings.WarningMessage]) -> str:
    """Links that touch for ever in one solid, and at times in others."""
    ball = '<collision><origin xyz="0 0 {}"/><geometry><sphere radius="{}"/></geometry></collision>'
    hub, far = (ball.format(0, 0.05) + ball.format(end, 0.03) for end in (-0.3, 0.3))
    text = (
        f'<robot name="r"><link name="base"/><link name="hub">{hub}</link><link name="w"/><link name="far">{far}</link>'
    )
    text += _joint("j1", "base", "hub") + _joint("j2", "hub", "w", reach="0", low=-0.1, high=0.1)
    text += _joint("j3", "w", "far", reach="0", low=-3.1, high=3.1) + "</robot>"
    (folder / "r.urdf").write_text(text)
    world = World(load_robot(folder / "r.urdf"))
    answers = (world.valid([0.0, 0.0, 3.1]), world.valid([0.0, 0.0, 0.0]))
    return _warned(caught, "'hub' (solid 1) and 'far' (solid 1)") or (
        "" if answers == (False, True) else f"folded, stretched: free {answers}"
    )


HEAD = '<mujoco><compiler angle="radian"/><worldbody>'
MASKS = (
    HEAD
    + """<body name="a"><joint name="j1" axis="0 1 0" range="-2 2"/>
<geom type="capsule" size=".03 .1" pos="0 0 .12"/><body name="b" pos="0 0 .3">
<joint name="j2" axis="0 1 0" range="-3 3"/><geom size=".03" pos="0 0 .1"/><body name="c" pos="0 0 .3">
<joint name="j3" axis="0 1 0" range="-3 3"/><geom size=".15" pos="0 0 .1" contype="2" conaffinity="2"/>
<geom size=".01" pos="0 0 .28"/></body></body></body></worldbody></mujoco>"""
)
LOOP = (
    HEAD
    + """<body name="c"><joint name="crank" axis="0 1 0" range="-1 1"/><geom size=".01" pos="0 0 .05"/>
<body name="r" pos="0 0 .1"><joint name="rod" axis="0 1 0" range="-2 2"/><geom size=".01" pos=".1 0 0"/></body></body>
<body name="s" pos=".2 0 .1"><joint name="slide" type="slide" axis="1 0 0" range="-.1 .1"/><geom size=".02"/></body>
</worldbody><equality><connect body1="r" body2="s" anchor=".2 0 0"/></equality></mujoco>"""
)
FLOOR = (
    HEAD
    + """<geom name="floor" type="plane" size="1 1 .1" pos="0 0 -.3"/><geom size=".2" pos=".5 0 .2"/>
<body name="base"><body name="first"><joint name="j1" axis="0 1 0" range="-3 3"/>
<geom type="capsule" size=".02" fromto=".1 0 0 .5 0 0"/></body></body></worldbody></mujoco>"""
)


def in_contact(text: str, robot: Robot, Q: Any) -> Iterator[bool]:
    """Of each posture: whether MuJoCo finds solids in each other."""
    import mujoco  # which nothing else of this report needs

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for q in Q:
        for name, value in zip(robot.joint_names, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_forward(model, data)
        yield any(contact.dist < 0.0 for contact in data.contact)


def _as_mujoco(text: str, *said: str, plane: bool = False) -> Case:
    def judge(folder: Path, caught: list[warnings.WarningMessage]) -> str:
        (folder / "arm.xml").write_text(text)
        robot = load_robot(folder / "arm.xml")
        Q = np.random.default_rng(0).uniform(*robot.finite_range(), (500, robot.dof))
        without = re.sub('<geom name="floor"[^>]*>', "", text) if plane else text
        different = int((np.fromiter(in_contact(without, robot, Q), bool) == World(robot).valid_batch(Q)).sum())
        return (_warned(caught, *said) if said else "") or (f"{different} of 500 postures differ" if different else "")

    return judge


CASES: dict[str, Case] = {
    "arguments of xacro in one text": _arguments('"--inorder long:=true"'),
    "arguments of xacro on lines": _arguments("\n      --inorder\n      long:=true"),
    "an old URDF for Gazebo": _gazebo,
    "an arm that is called a gripper, with a solver": _gripper("arm: {kinematics_solver: kdl}\n"),
    "the same without a solver": _gripper("{}"),
    "follower -a + 0.1 in [-0.2, 0.2]": _mimic(-1, 0.1, (-0.2, 0.2), (-0.1, 0.3)),
    "follower 2 a in [-1, 1]": _mimic(2, 0, (-1, 1), (-0.5, 0.5)),
    "follower a in [0, 1]": _mimic(1, 0, (0, 1), (0, 1)),
    "follower a + 3 in [-1, 1]": _mimic(1, 3, (-1, 1), None),
    "a pair of links with one that is not there": _srdf_fault(
        'link2="upper"', 'link2="uper"', "arm.srdf:21", "'uper'", "did you mean 'upper'"
    ),
    "a posture with a joint that is not there": _srdf_fault(
        '"elbow" value', '"elbo" value', "arm.srdf:17", "'elbo'", "did you mean 'elbow'"
    ),
    "a posture outside the limits": _srdf_fault(
        '"elbow" value="0.1"', '"elbow" value="2.5"', "arm.srdf:15", "'home'", "'elbow'"
    ),
    "two links with an empty one between": _folding(""),
    "the same with an SRDF": _folding('<enable_collisions link1="fore" link2="hand"/>'),
    "solids that always touch": _capsules,
    "masks of geoms": _as_mujoco(MASKS),
    "a loop": _as_mujoco(LOOP, "arm.xml", "connect of 'r' and 's'"),
    "a floor, and a ball beside the first link": _as_mujoco(FLOOR, "arm.xml", "plane 'floor'", plane=True),
}
