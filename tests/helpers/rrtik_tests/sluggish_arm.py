"""An honest arm that is no model of precision: it reads late or coarsely, sticks, or is slow."""

from collections import deque

import numpy as np

from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_tests.pilot_session import PROBLEM, ROBOT

PARTS = 10  # of each advance, so that readings are late by what they shall be


class SluggishArm(SimulatedArm):
    """A simulated arm that does what it is told, as real ones do it.

    Args:
        late: Age of its readings [s].
        grain: Resolution of its encoders [deg].
        stick: A joint at rest does not move towards a set point that is nearer than this [deg].
        slow: Share of its rates that it reaches.
    """

    def __init__(self, late=0.0, grain=0.0, stick=0.0, slow=1.0):
        super().__init__(ROBOT, PROBLEM.start)
        self._late = late
        self._grain = np.radians(grain)
        self._stick = np.radians(stick)
        self._rates = slow * self._rates
        self._time = 0.0
        self._past = deque([(0.0, self._q.copy())])
        self._moves = np.zeros(ROBOT.dof, dtype=bool)

    def advance(self, seconds):
        for _ in range(PARTS):
            to_go = self._told() - self._q
            self._moves = np.abs(to_go) > np.where(self._moves, 1e-9, self._stick)
            step = self._rates * (seconds / PARTS)
            self._q = self._q + np.where(self._moves, np.clip(to_go, -step, step), 0.0)
            self._time += seconds / PARTS
            self._past.append((self._time, self._q.copy()))
        while len(self._past) > 1 and self._past[1][0] <= self._time - self._late:
            self._past.popleft()

    def _told(self):
        """Where the joints shall be."""
        if self._course is not None:
            return self._course
        told = self._q.copy()
        if self._goal is not None:
            told[self._goal[0]] = self._goal[1]
        return told

    def read(self):
        q = self._past[0][1].copy()
        return np.round(q / self._grain) * self._grain if self._grain else q
