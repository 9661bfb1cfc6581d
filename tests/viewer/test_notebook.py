"""What a notebook shows: short lines and pages in frames; nothing that waits for Ctrl-C."""

import base64
import html
import pickle
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer import play
from rrtik_ompl.viewer.notebook import InlinePage


@pytest.fixture(scope="module")
def problem():
    return rrtik.load_problem("planar3_boxes")


@pytest.fixture(scope="module")
def plan(problem):
    return rrtik.plan(problem, seed=1)


@pytest.fixture
def kernel(monkeypatch):
    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))


def page_in(frame):
    return html.unescape(re.search(r'<iframe [^>]* srcdoc="([^"]*)"></iframe>', frame, re.DOTALL)[1])


def without_picture(page):
    """A page without the picture for browsers that draw nothing; in a notebook a larger one stands beside it."""
    return re.sub(r'(?<=type="image/png">)[\w+/=]*', "", page)


def test_a_problem_a_world_and_a_plan_draw_the_page_of_view(problem, plan, tmp_path):
    for shown, path, still in ((problem, None, False), (problem.world, None, True)):
        rrtik.view(shown, path, html=tmp_path / "page.html", still=still)
        assert page_in(shown._repr_html_()) == without_picture((tmp_path / "page.html").read_text())
    rrtik.view(problem, plan.path, html=tmp_path / "page.html")
    assert page_in(plan._repr_html_()) == without_picture((tmp_path / "page.html").read_text())


def test_a_printed_notebook_shows_the_first_view_alone(problem, plan):
    """The picture beside the page, in its own right; text where nothing can be drawn."""
    motion = rrtik.time_parameterize(plan.path, rrtik.load_robot("planar3"))
    for shown in (problem, problem.world, plan, plan.path, motion):
        assert base64.b64encode(shown._repr_png_()).decode() in shown._repr_html_()
    assert rrtik.JointPath([[0.0], [1.0]], robot_name="nobody's")._repr_png_() is None


def test_paths_and_trajectories_draw_their_robot(plan):
    motion = rrtik.time_parameterize(plan.path, rrtik.load_robot("planar3"))
    assert f"path of {plan.path.transitions} moves" in page_in(plan.path._repr_html_())
    assert "iframe" in motion._repr_html_()
    assert rrtik.JointPath([[0.0], [1.0]], robot_name="nobody's")._repr_html_() is None  # the text is shown instead


def test_a_plan_from_another_process_still_draws_its_path(plan):
    sent = pickle.loads(pickle.dumps(plan))
    assert sent.problem is None
    assert f"path of {plan.path.transitions} moves" in page_in(sent._repr_html_())


@pytest.mark.usefixtures("kernel")
def test_nothing_blocks_a_notebook(problem):
    assert isinstance(rrtik.view(problem), InlinePage)
    with pytest.raises(rrtik.InputError, match="stop the notebook"):
        play(problem)


def test_a_page_inline_where_it_is_asked_for(problem):
    assert isinstance(rrtik.view(problem, inline=True, still=True), InlinePage)


def test_results_are_lines(problem, plan):
    robot = problem.robot
    poses = robot.fk_batch(np.linspace(plan.path.start, plan.path.end, 200))
    results = [
        plan,
        rrtik.solve_ik(robot, rrtik.PositionGoal(poses[0][:3, 3], tolerance=0.01)),
        rrtik.ik.reach_map(robot, samples=500, seed=1),
        rrtik.time_parameterize(plan.path, robot).report(rrtik.RateLimits.of(robot)),
        problem.world.certificate(plan.path, 0.0),
        rrtik.Mesh(np.random.default_rng(1).normal(size=(90, 3)), np.arange(90).reshape(30, 3)),
    ]
    ur5 = rrtik.load_robot("ur5")
    results.append(rrtik.ik.solve_trajectory(ur5, ur5.fk_batch(np.linspace(np.full(6, 0.5), np.full(6, 0.7), 200))))
    for result in results:
        assert "\n" not in repr(result)
        assert len(repr(result)) < 400, repr(result)
