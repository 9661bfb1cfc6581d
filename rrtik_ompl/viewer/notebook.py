"""Display of values of the library in a notebook, as the offline page."""

from __future__ import annotations

import base64
import html
import sys
from dataclasses import dataclass

from rrtik_ompl.description.catalog import robot_called
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.planning.outcome import Plan
from rrtik_ompl.viewer.page import page_and_picture
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.still import first_picture
from rrtik_ompl.viewer.subject import Showable, subject_of
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

HEIGHT = 520  # [px]; height of the frame


@dataclass(frozen=True, slots=True, eq=False)
class InlinePage:
    """A page that a notebook shows in the output of a cell.

    Attributes:
        text: The whole page; it needs no other file and no network.
        picture: Its first view as a PNG, for where scripts do not run.
        height: Height of the frame around it [px].
    """

    text: str
    picture: bytes
    height: int = HEIGHT

    def __repr__(self) -> str:
        return f"InlinePage({len(self.text) / 1e6:.1f} MB; a notebook shows it)"

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, so that it does not interfere with the notebook.

        The frame covers the picture, which is seen where frames are taken out, as on sites that show notebooks.
        """
        source = base64.b64encode(self.picture).decode("ascii")
        size = f"width: 100%; height: {self.height}px"
        image = f'<img alt="first view" style="{size}; object-fit: contain" src="data:image/png;base64,{source}">'
        style = f"position: absolute; inset: 0; {size}; border: 0"
        frame = f'<iframe title="3-D page" style="{style}" srcdoc="{html.escape(self.text)}"></iframe>'
        return f'<div style="position: relative; height: {self.height}px">{image}{frame}</div>'

    def _repr_png_(self) -> bytes:
        """Return the picture, which is what printed notebooks show."""
        return self.picture


def html_of(value: Plan | JointPath | Problem | World | Trajectory) -> str | None:
    """Return what a notebook shows of a value; None if nothing can be drawn, so that its text is shown."""
    parts = _parts_of(value)
    if parts is None:
        return None
    planning = isinstance(value, (Plan, Problem))
    return InlinePage(*page_and_picture(*parts, tree=getattr(value, "tree", None), still=not planning))._repr_html_()


def png_of(value: Plan | JointPath | Problem | World | Trajectory) -> bytes | None:
    """Return the picture that a printed notebook shows of a value; None if nothing can be drawn."""
    parts = _parts_of(value)
    if parts is None:
        return None
    subject = subject_of(*parts)
    return first_picture(subject, *draw(subject))


def _parts_of(
    value: Plan | JointPath | Problem | World | Trajectory,
) -> tuple[Showable, JointPath | Trajectory | None] | None:
    """Return what is shown of a value, and the motion that is played; None if nothing can be drawn.

    A path or a trajectory knows its robot only by name, so it is drawn only for shipped robots.
    """
    if isinstance(value, Plan):
        if value.problem is None:
            return None if value.path is None else _parts_of(value.path)
        return value.problem, value.path
    if isinstance(value, (JointPath, Trajectory)):
        robot = robot_called(value.robot_name, value.joint_names)
        return None if robot is None else (robot, value)
    return value, None


def in_kernel() -> bool:
    """Check whether this process runs the cells of a notebook, where waiting for Ctrl-C would block everything."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None
