"""Following a path of all joints at once, for an arm under position control: where it is on it, what is ahead.

Source: [1, ch. 6] (comparison with lists of single-joint moves).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import Move
from rrtik_ompl.pilot.routes.clearance import proven_clearance
from rrtik_ompl.pilot.routes.follower import MADE, TOLERANCE, Progress, slack
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

PLANNER_SECONDS = 5.0
STAGE = "with all joints at once"
AHEAD_SECONDS = 0.5  # within which the arm is looked for on its path
PLACES = 51  # at which it is looked for


@dataclass(frozen=True, eq=False)
class Track:
    """Tracks an arm along a path, as a value: `update` gives the next one.

    Attributes:
        path: The path.
        rates: Of the joints when they are driven, shape (dof,) [rad/s or m/s].
        tolerance: Largest error of a joint [rad].
        current: 0 until the end is reached, then 1.
        at: Where on the path the arm is, in seconds from its start.
    """

    path: JointPath
    rates: Vector
    tolerance: float = TOLERANCE
    current: int = 0
    at: float = 0.0

    @property
    def moves(self) -> tuple[Move, ...]:
        """None: it has no moves of single joints."""
        return ()

    @cached_property
    def slack(self) -> Vector:
        """How far each joint may be off the path, shape (dof,) [rad or m]."""
        return slack(self.path, self.tolerance)

    @cached_property
    def _times(self) -> Vector:
        """When the arm is at each waypoint if the slowest joint of each piece goes at its rate."""
        times = (np.abs(np.diff(self.path.waypoints, axis=0)) / self.rates).max(axis=1)
        return np.concatenate([[0.0], np.cumsum(times)])

    @property
    def seconds(self) -> float:
        """That the whole path takes."""
        return float(self._times[-1])

    @property
    def done(self) -> bool:
        """Whether the end is reached."""
        return self.current == 1

    @property
    def target(self) -> Vector:
        """Where it ends. Shape (dof,)."""
        return self.path.end

    def joint(self) -> int | None:
        """None: no single joint is due."""
        return None

    def update(self, q: Vector) -> tuple[Track, Progress]:
        """The track with the place that an arm at q has reached, and the arm's progress."""
        places = np.linspace(self.at, min(self.at + AHEAD_SECONDS, self.seconds), PLACES)
        errors = np.abs(np.array([self._place(seconds) for seconds in places]) - q) / self.slack

        nearest = int(errors.max(axis=1).argmin())
        if errors[nearest].max() > 1.0:
            return self, Progress(0, self.share, 0.0, "lost", self._fault(q, int(errors[nearest].argmax())))

        if self.done or np.abs(q - self.path.end).max() <= MADE:
            return replace(self, current=1, at=self.seconds), Progress(1, 1.0, 0.0, "done")

        advanced = replace(self, at=float(places[nearest]))
        return advanced, Progress(0, advanced.share, advanced.seconds - advanced.at, "move")

    def ahead(self, seconds: float) -> Vector:
        """The place on the path that is so much ahead of the arm. Shape (dof,)."""
        return self._place(min(self.at + seconds, self.seconds))

    def pass_on(self, q: Vector) -> tuple[Track, str, str]:
        """There is no move that could be passed over.

        Raises:
            InputError: Always.
        """
        raise InputError("no move is due")

    def rest(self, q: Vector) -> JointPath:
        """What remains, from q."""
        waypoints_ahead = self.path.waypoints[np.searchsorted(self._times, self.at, side="right") :]
        return self.path.with_waypoints(
            np.vstack([q, waypoints_ahead if len(waypoints_ahead) else self.path.end[None]])
        )

    def back(self, q: Vector) -> JointPath:
        """The path back to the beginning."""
        waypoints_behind = self.path.waypoints[: np.searchsorted(self._times, self.at, side="right")]
        return self.path.with_waypoints(np.vstack([q, waypoints_behind[::-1]]))

    def _place(self, seconds: float) -> Vector:
        return np.array([np.interp(seconds, self._times, column) for column in self.path.waypoints.T])

    @property
    def share(self) -> float:
        """Of the path that is behind the arm, 0 to 1."""
        return self.at / self.seconds if self.seconds > 0.0 else 1.0

    def _fault(self, q: Vector, joint: int) -> str:
        unit = joint_unit(self.path.prismatic[joint])
        (shown_value, unit_name), (shown_planned, _) = (
            reading(float(row[joint]), unit) for row in (q, self._place(self.at))
        )
        return f"{self.path.joint_names[joint]} is at {shown_value:.2f} {unit_name} instead of {shown_planned:.2f}"


def together(route: Route, world: World, rates: Vector, seed: int) -> Route | NoRoute:
    """The same route with all joints at once, up to its last moves to the object, which stay as they are.

    Args:
        route: Of single-joint moves.
        world: In which nothing may be touched.
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    rows = route.path.waypoints
    before = rows[route.grasp_from]
    last = rows[route.grasp_from + 1 :]
    if route.grasp_from == 0:
        return NoRoute("only moves of single joints are left", STAGE)

    problem = Problem(world, rows[0], before)
    planned = plan(problem, "rrtconnect", seconds=PLANNER_SECONDS, seed=seed)
    if planned.path is None:
        return NoRoute(planned.reason, STAGE)

    path = shorten(planned.path, problem, seed=seed)
    whole_path = path.with_waypoints(np.vstack([path.waypoints, last]))

    moving_joints = tuple(
        name
        for name, travel in zip(whole_path.joint_names, np.ptp(whole_path.waypoints, axis=0), strict=True)
        if travel > 0
    )
    return replace(
        route, path=whole_path, grasp_from=len(path.waypoints) - 1, joints=moving_joints,
        seconds=Track(whole_path, rates).seconds,
        travel=float(np.abs(np.diff(whole_path.waypoints, axis=0)).sum()),
        clearance=min(proven_clearance([(world, path.waypoints)]), route.clearance),
        proven=bool(world.prove(path.waypoints).proven) and route.proven, together=True,
    )  # fmt: skip
