"""Which goal configurations the attempts of a planner get, where a clearance leaves some of the known ones out."""

from types import SimpleNamespace

import numpy as np

from rrtik_ompl.ompl_bridge.planner_traits import PlannerTraits
from rrtik_ompl.planning import goal_choice as module
from rrtik_ompl.planning.goal_choice import GoalChoice

ROUNDS = (4, 3, 0)  # configurations that each round of the search adds; every second one keeps the clearance


class CountedSearch:
    """Stands for `GoalSearch`: configurations are their own numbers."""

    exhausted = False
    reason = ""

    def __init__(self, *_, **__):
        self.rows = np.zeros((0, 1))
        self._waiting = list(ROUNDS)

    def first(self):
        if len(self.rows) == 0:
            self.more()
        return self.rows

    def more(self):
        added = self._waiting.pop(0)
        self.rows = np.arange(len(self.rows) + added, dtype=float)[:, None]
        return added > 0


def keeps(rows, _, *, clearance):
    return rows[:, 0] % 2 == 1


def chosen(monkeypatch, clearance, start=-100.0):
    monkeypatch.setattr(module, "weighted_difference", lambda robot, rows, q: rows - q)
    monkeypatch.setattr(module, "GoalSearch", CountedSearch)
    world = SimpleNamespace(prover=SimpleNamespace(proven=keeps))
    problem = SimpleNamespace(goal=SimpleNamespace(q=None), robot=None, world=world, start=np.array([start]))
    request = SimpleNamespace(clearance=clearance)
    choice = GoalChoice(problem, PlannerTraits(), request, range(3), seconds_left=lambda: 1.0)
    return [choice.of(attempt)[:, 0].tolist() for attempt in range(3)]


def test_new_configurations_come_first_and_where_there_are_none_another_one_at_each_attempt(monkeypatch):
    assert chosen(monkeypatch, None) == [[0, 1, 2, 3], [4, 5, 6, 0, 1, 2, 3], [2, 3, 4, 5, 6, 0, 1]]


def test_new_configurations_that_keep_the_clearance_come_before_the_known_ones_that_do(monkeypatch):
    assert chosen(monkeypatch, 0.01) == [[1, 3], [5, 1, 3], [5, 1, 3]]


def test_the_first_attempt_leaves_out_what_is_more_than_twice_as_far_as_the_nearest(monkeypatch):
    assert chosen(monkeypatch, None, start=-1.5)[:2] == [[0, 1], [4, 5, 6, 0, 1, 2, 3]]
