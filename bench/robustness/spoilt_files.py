"""Files of every kind that the library reads, spoilt in a few places."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.files.messages import message_in

URDF = """<robot name="arm"><link name="base"/><link name="hand"><collision><geometry><sphere radius="0.1"/></geometry>
</collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
PROBLEM = """version: 1
robot: {planar: {lengths: [1, 1], limits_deg: [[-90, 90], [-90, 90]], radius: 0.01}}
scene:
  obstacles:
    - {name: wall, box: [0.2, 0.2, 1], pose: {xyz: [-1.5, 0, 0], rpy_deg: [0, 0, 10]}, margin: 0.01}
    - {name: ball, sphere: 0.1, pose: {xyz: [-3, 0, 0], quat_xyzw: [0, 0, 0, 1]}}
start: {joints_deg: [0, 0]}
goal: {joints_deg: [45, 30]}
"""
STL = "solid a\n" + "".join(
    f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    for corners in ("vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n", "vertex 0 0 1\nvertex 1 0 0\nvertex 0 1 0\n")
)
MJCF = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="base"><geom size=".1"/>
<body name="hand" pos="0.5 0 0"><joint name="turn" axis="0 0 1" range="-1 1"/><geom type="box" size=".1 .1 .1"/>
<site name="tip"/></body></body></worldbody><keyframe><key name="home" qpos="0"/></keyframe></mujoco>"""
FILES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "problem.yaml": (PROBLEM, rrtik.load_problem),
    "arm.urdf": (URDF, rrtik.load_robot),
    "arm.xml": (MJCF, rrtik.load_robot),
    "dh.yaml": (
        "version: 1\nname: arm\ndh: {convention: standard, rows: [{a: 1, limits_deg: [-90, 90]}]}\n",
        rrtik.load_robot,
    ),
    "path.json": ('{"version": 1, "joint_names": ["a", "b"], "waypoints": [[0, 0], [0.5, 0]]}', rrtik.JointPath.load),
    "path.csv": ("a,b\n0,0\n1,0.5\n", rrtik.JointPath.load),
    "mesh.stl": (STL, rrtik.Mesh.load),
    "message": ('{"name": "jog", "direction": 0.1, "press": 2, "seq": 3}', lambda path: message_in(path.read_bytes())),
}
BITS = (
    "nan",
    "1e999",
    "-1",
    "0",
    "[" * 50,
    "]",
    "{",
    "}",
    '"',
    "\x1b[2J",
    "\ud7ff",
    "null",
    "9" * 400,
    ":",
    "<",
    "&a;",
    "",
)


def spoilt(rng: np.random.Generator, text: str) -> str:
    """A text with one to three places overwritten."""
    for _ in range(rng.integers(1, 4)):
        at, length = rng.integers(len(text) + 1), int(rng.integers(0, 12))
        text = text[:at] + BITS[rng.integers(len(BITS))] + text[at + length :]
    return text


class Drawn(NamedTuple):
    """A call that is drawn, and not made yet.

    Attributes:
        said: What it is, in a few words; asked only of calls that something is wrong with.
        make: Makes it, in a folder.
    """

    said: Callable[[], str]
    make: Callable[[Path], object]


def write(file: Path, text: str) -> None:
    """Write a text, half letters too."""
    file.write_bytes(text.encode("utf-8", errors="surrogatepass"))


def draw(rng: np.random.Generator) -> Drawn:
    """A file that is spoilt and read."""
    name = list(FILES)[rng.integers(len(FILES))]
    text = spoilt(rng, FILES[name][0])
    return Drawn(lambda: f"{name}: {text}", partial(_read, name, text))


def _read(name: str, text: str, folder: Path) -> None:
    write(folder / name, text)
    FILES[name][1](folder / name)
