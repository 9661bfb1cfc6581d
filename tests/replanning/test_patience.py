"""Feeds that hang, end or break: the run ends in one line, and the record has what was before."""

import threading

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError

SETTINGS = {"step": 0.05, "rate": 20.0, "seconds": 2.0, "seed": 1, "repair_budget": 30.0}


@pytest.fixture
def problem():
    return rrtik.replanning.Scenario.load("replan_walls").problem


@pytest.fixture
def never():
    event = threading.Event()
    yield event
    event.set()  # lets the thread go


def hanging(answer, last, never):
    """A feed that answers up to a time [s]."""

    def feed(time):
        if time > last:
            never.wait()
        return answer

    return feed


def test_a_feed_that_hangs_ends_the_run_and_the_record_has_what_was_before(problem, never, tmp_path):
    feed = hanging(problem.world.scene, 0.2, never)
    with pytest.raises(InputError, match=r"scene feed.*0\.25 s.*0\.5 s.*feed_patience"):
        rrtik.replan(problem, feed, **SETTINGS, record=tmp_path / "run.json", feed_patience=0.5)
    run = rrtik.replanning.ReplanRun.load(tmp_path / "run.json")
    assert (len(run.ticks), run.outcome) == (5, "interrupted")


def test_pairs_that_stop_coming_end_the_run(problem, never):
    def pairs():
        yield 0.0, problem.world.scene
        never.wait()

    with pytest.raises(InputError, match=r"scene feed.*0 s.*0\.5 s"):
        rrtik.replan(problem, pairs(), **SETTINGS, feed_patience=0.5)


def test_a_goal_that_stops_coming_ends_the_run(problem, never):
    with pytest.raises(InputError, match=r"goal feed.*0\.1 s"):
        rrtik.replan(problem, goal_feed=hanging(problem.goal.q, 0.05, never), **SETTINGS, feed_patience=0.5)


def test_what_a_feed_raises_arrives(problem):
    def broken(time):
        raise InputError("the camera broke")

    with pytest.raises(InputError, match=r"^the camera broke$"):
        rrtik.replan(problem, broken, **SETTINGS)


def test_a_feed_is_asked_in_one_thread_and_gives_the_same_run(problem):
    asked = set()

    def feed(time):
        asked.add(threading.get_ident())
        return problem.world.scene

    runs = [rrtik.replan(problem, source, **SETTINGS) for source in (None, feed)]
    assert runs[0].configurations.tolist() == runs[1].configurations.tolist()
    assert len(asked) == 1


@pytest.mark.parametrize("patience", [0.0, -1.0, float("nan"), "x"])
def test_patience_is_more_than_nothing(problem, patience):
    with pytest.raises(InputError, match="feed_patience"):
        rrtik.replan(problem, **SETTINGS, feed_patience=patience)
