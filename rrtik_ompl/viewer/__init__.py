"""Pictures that a person can turn, play and step through: one HTML page, written to a file or served to this machine.

No package below this one imports it. Only the script of meshcat's viewer is used; meshcat itself is imported by those
alone who give a visualizer of it.
"""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from rrtik_ompl.base.errors import InputError, called, require
from rrtik_ompl.files.text import PAGE_FORMATS, check_target, file_name, write_text

if TYPE_CHECKING:
    from rrtik_ompl.replanning.record import ReplanRun
    from rrtik_ompl.viewer.asked import Asked, AskedPath, AskedTree
    from rrtik_ompl.viewer.drawing.marks import Mark
    from rrtik_ompl.viewer.notebook import InlinePage
    from rrtik_ompl.viewer.subject import ShownPath
    from rrtik_ompl.world.problem import Problem

__all__ = ["play", "view"]


def view(
    shown: Asked,
    path: AskedPath | None = None,
    *,
    before: ShownPath | None = None,
    ghosts: ArrayLike | None = None,
    marks: Sequence[Mark] = (),
    run: ReplanRun | None = None,
    tree: AskedTree | None = None,
    html: str | os.PathLike[str] | None = None,
    title: str | None = None,
    still: bool = False,
    inline: bool | None = None,
    meshcat: object = None,
    port: int = 0,
    on_ready: Callable[[str], object] = webbrowser.open,
) -> Path | InlinePage | None:
    """Show a problem and a path: robot, obstacles, start and goal as ghosts, the trail of the tip, and a player.

    Args:
        shown: A ``Problem``, ``World``, ``Robot`` or ``Scene``; or a ``Plan`` or ``TaskPlan``, which bring their path.
        path: A ``JointPath``, or waypoints of shape (k, dof) [rad or m]; None shows no motion. A ``Trajectory`` is
            played in real time; a ``TaskPlan`` (with the first of its worlds), or the result of its ``played()``, is
            played motion by motion, with the objects that are carried.
        before: Another path for comparison, such as the one that ``path`` was shortened from: the trail of its tip is
            drawn, too.
        ghosts: Configurations at which the arm is drawn transparently, shape (k, dof), such as solutions of inverse
            kinematics; they replace the ghosts of start and goal. If the goal of a problem is one of them, the page
            plans to the ghost that is chosen there.
        marks: Further bodies: see ``rrtik_ompl.viewer.drawing.marks``.
        run: A ``ReplanRun`` of :func:`rrtik_ompl.replan` to replay instead of a path.
        tree: How a planner has searched: ``plan(tree=True).tree``, or a ``Roadmap``; it is drawn, and grows step by
            step. None and True stand for the tree that a ``Plan`` has kept, if there is one; False draws none.
        html: File to write. If None, the page is served on 127.0.0.1 until Ctrl-C is pressed.
        title: Heading of the page; None derives it from the name of the problem or robot.
        still: Whether to leave out the planner of the page. With it, start, goal and obstacles of a problem can be
            dragged, and the page finds new paths by itself, without a network.
        inline: Whether to return the page for the output of a notebook's cell; None: if this runs in a notebook.
        meshcat: A ``meshcat.Visualizer`` or pinocchio's ``MeshcatVisualizer`` to draw into, below its node "rrtik", in
            place of a page: arm, obstacles, goal, trail, and the motion as an animation. Its server has to run.
        port: Port to serve on; 0 chooses a free one.
        on_ready: Called with the URL once the page is being served; opens the browser by default.

    Returns:
        The file that was written, the page that a notebook shows, or None after serving or with ``meshcat``.

    Raises:
        InputError: If the input cannot be shown, the file cannot be written or the port cannot be used.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> rrtik.view(problem, rrtik.plan(problem, seed=1).path, html="plan.html").name
        'plan.html'
    """
    from rrtik_ompl.viewer.asked import parts_of
    from rrtik_ompl.viewer.notebook import InlinePage, in_kernel
    from rrtik_ompl.viewer.page import page_and_picture
    from rrtik_ompl.viewer.serve import PageServer

    called(on_ready, "on_ready", "an address")
    require(title, str | None, "title of a page")
    require(still, bool, "still")
    require(inline, bool | None, "inline")
    check_target(None if html is None else file_name(html), PAGE_FORMATS)

    parts = parts_of(shown, path, before, tree)
    if meshcat is not None:
        if html is not None:
            raise InputError("view: give html or meshcat, not both; call view twice")
        from rrtik_ompl.viewer.meshcat_door import draw_into

        draw_into(meshcat, parts, run)
        return None
    in_cell = html is None and (in_kernel() if inline is None else inline)
    text, image = page_and_picture(
        parts.shown,
        parts.path,
        before=parts.before,
        ghosts=ghosts,
        marks=marks,
        run=run,
        tree=parts.tree,
        title=title,
        still=still,
        picture=in_cell,
    )
    if html is not None:
        write_text(html, text)
        return Path(html)
    if in_cell:
        return InlinePage(text, image)

    with PageServer(text, port) as server:
        on_ready(server.url)
        server.wait()
    return None


def play(
    problem: Problem,
    path: ShownPath | None = None,
    *,
    port: int = 0,
    on_ready: Callable[[str], object] = webbrowser.open,
) -> None:
    """Serve the page that plans, with this process as a second opinion, until Ctrl-C is pressed.

    Whenever something is dragged, the page finds a path by itself and sends it here to be proven; it displays the
    result.

    Args:
        problem: A problem.
        path: The first path: a ``JointPath``, or waypoints of shape (k, dof) [rad or m]; None for none.
        port: Port on 127.0.0.1; 0 chooses a free one.
        on_ready: Called with the URL once the page is being served; opens the browser by default.

    Raises:
        InputError: If the page of this problem cannot plan, the port cannot be used, or this runs in a notebook.
    """
    from rrtik_ompl.viewer.notebook import in_kernel
    from rrtik_ompl.viewer.opinion import opinion
    from rrtik_ompl.viewer.page import page
    from rrtik_ompl.viewer.serve import PageServer

    if in_kernel():
        raise InputError("play: it would serve its page until Ctrl-C and stop the notebook; use view(problem, path)")

    with PageServer(page(problem, path, asks=True), port, lambda asked: opinion(problem, asked)) as server:
        on_ready(server.url)
        server.wait()
