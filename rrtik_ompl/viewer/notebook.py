"""The offline page inside a notebook: what values of the library draw of themselves there."""

from __future__ import annotations

import html
import sys
from dataclasses import dataclass

from rrtik_ompl.description.catalog import robot_called
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.planning.plan import Plan
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.subject import Showable
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

HEIGHT = 520  # [px] of the frame


@dataclass(frozen=True, slots=True, eq=False)
class InlinePage:
    """A page that a notebook shows in the output of its cell.

    Attributes:
        text: The whole page; it needs no other file and no network.
        height: Of the frame around it [px].
    """

    text: str
    height: int = HEIGHT

    def __repr__(self) -> str:
        return f"InlinePage({len(self.text) / 1e6:.1f} MB; a notebook shows it)"

    def _repr_html_(self) -> str:
        """The page in a frame of its own, so that neither disturbs the other."""
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="3-D page" style="{style}" srcdoc="{html.escape(self.text)}"></iframe>'


def html_of(value: Plan | JointPath | Problem | World | Trajectory) -> str | None:
    """What a notebook shows of a value; None, which leaves it at its text, where there is nothing to draw.

    A path or a trajectory alone knows its robot by name; of a robot that is not shipped there is no picture.
    """
    if isinstance(value, Plan):
        if value.problem is None:
            return None if value.path is None else html_of(value.path)
        shown: Showable = value.problem
        path: JointPath | Trajectory | None = value.path
    elif isinstance(value, (JointPath, Trajectory)):
        robot = robot_called(value.robot_name, value.joint_names)
        if robot is None:
            return None
        shown = robot
        path = value
    else:
        shown = value
        path = None

    planning = isinstance(value, (Plan, Problem))
    return InlinePage(page(shown, path, still=not planning))._repr_html_()


def in_kernel() -> bool:
    """Whether this process runs the cells of a notebook, where waiting for Ctrl-C would stop everything."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None
