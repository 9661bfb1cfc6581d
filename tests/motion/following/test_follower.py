"""Trajectories followed: on their path, within limits whatever is asked, at rest when told."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.following.follower import Follower, SimulatedLink
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.line_arm import ArmLink, LineArm, LineServer
from rrtik_ompl.world.world import World
from rrtik_tests.waiting import until

TICK = 2e-3
ROBOT = load_robot("planar3")
LIMITS = RateLimits([1.0, 1.5, 1.0], [3.0, 3.0, 4.0], [30.0, 30.0, 40.0])
PATH = JointPath.of(ROBOT, [[0.0, 0.0, 0.0], [1.0, 0.8, -0.3], [1.5, -0.5, 0.5]])
MOTION = time_parameterize(PATH, LIMITS, blend=0.3, world=World(ROBOT))


def follower_at(start=PATH.start, **options):
    link = SimulatedLink(ROBOT, start)
    return Follower(MOTION, link, limits=LIMITS, **options), link


def assert_within_limits(rows):
    for power, limit in ((1, LIMITS.velocity), (2, LIMITS.acceleration), (3, LIMITS.jerk)):
        rates = np.abs(np.diff(rows, power, axis=0)) / TICK**power
        assert (rates <= limit * 1.01 + 1e-6).all(), power


def test_without_disturbance_the_set_points_are_the_trajectory():
    follower, link = follower_at()
    while not follower.ended:
        follower.step(TICK)
    clock, rows = np.array([t for t, _ in link.sent]), np.array([q for _, q in link.sent])
    assert np.allclose(rows, MOTION(clock).positions, atol=1e-12)
    assert follower.result.arrived
    assert follower.result.seconds == pytest.approx(MOTION.duration, abs=2 * TICK)
    assert (link.positions() == PATH.end).all()


asks = st.lists(st.tuples(st.floats(0.02, 1.5), st.sampled_from(["pause", "resume", 0.2, 0.6, 1.0])), max_size=6)


@settings(max_examples=10)
@given(asks)
@example(asked=[(1.4296875, 0.6), (0.62890625, 1.0)])  # its jerk jumps between two looks
def test_pauses_and_paces_keep_the_limits_and_the_path(asked):
    follower, link = follower_at()
    moments = np.cumsum([wait for wait, _ in asked])
    queue = list(zip(moments, (what for _, what in asked), strict=True))
    places = []
    for k in range(30_000):
        while queue and k * TICK >= queue[0][0]:
            what = queue.pop(0)[1]
            if isinstance(what, str):
                getattr(follower, what)()
            else:
                follower.pace(what)
        if not queue and k * TICK > 1.5 + (moments[-1] if len(moments) else 0.0):
            follower.resume()
        follower.step(TICK)
        places.append(follower.place)
        if follower.ended:
            break
    assert follower.result.arrived
    rows = np.array([PATH.start] * 3 + [q for _, q in link.sent] + [PATH.end] * 3)
    assert_within_limits(rows[:-4])
    assert np.allclose(rows[3:-3], MOTION(places).positions, atol=1e-12)
    assert (np.diff(places) >= -1e-12).all()


@pytest.mark.parametrize("moment", [0.05, 0.4, 0.9, 1.4])
def test_a_stop_comes_to_rest_on_the_path_within_limits(moment):
    follower, link = follower_at()
    while follower.result.seconds < moment:
        follower.step(TICK)
    follower.stop("a hand in the way")
    before = follower.result.seconds
    while not follower.ended:
        follower.step(TICK)
    rows = np.array([q for _, q in link.sent])
    assert_within_limits(rows)
    assert follower.result.seconds - before <= 1.0
    if not follower.result.arrived:
        assert follower.result.reason == "a hand in the way"
        assert np.abs(rows[-1] - rows[-2]).max() <= 1e-6


def test_run_keeps_time_and_stops_an_arm_that_does_not_follow():
    now = [0.0]

    def sleep(seconds):
        now[0] += max(seconds, 1e-4)

    follower, _ = follower_at()
    assert follower.run(clock=lambda: now[0], sleep=sleep).arrived
    assert now[0] == pytest.approx(MOTION.duration, abs=0.03)

    class Stuck(SimulatedLink):
        def command(self, q, t):
            pass

    stuck = Follower(MOTION, Stuck(ROBOT, PATH.start), limits=LIMITS)
    found = stuck.run(clock=lambda: now[0], sleep=sleep)
    assert not found.arrived
    assert "joint" in found.reason
    assert "\n" not in found.reason


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (ConnectionError("cable\nout"), "cable out"),
        (TimeoutError(), "TimeoutError"),
        (np.zeros(2), "shape"),
        (None, "positions"),
        ([np.nan, 0.0, 0.0], "finite"),
    ],
)
def test_an_arm_that_cannot_say_where_it_is_comes_to_rest_within_limits(told, words):
    class Mute(SimulatedLink):
        def positions(self):
            if len(self.sent) < 30:
                return super().positions()
            if isinstance(told, Exception):
                raise told
            return told

    now, link = [0.0], Mute(ROBOT, PATH.start)
    follower = Follower(MOTION, link, limits=LIMITS, rate=1.0 / TICK)
    found = follower.run(clock=lambda: now[0], sleep=lambda seconds: now.__setitem__(0, now[0] + max(seconds, 1e-4)))
    assert follower.ended
    assert found.place < MOTION.duration
    assert "cannot be read" in found.reason
    assert words in found.reason
    assert "\n" not in found.reason
    rows = np.vstack([PATH.start, *(q for _, q in link.sent)])
    assert_within_limits(rows)
    assert np.abs(rows[-1] - rows[-2]).max() <= 1e-6


def test_limits_that_the_trajectory_exceeds_are_refused():
    """No change of pace would keep them, so a stop would never begin."""
    for share, what in ((0.3, "velocity"), (1.0 - 1e-5, "velocity")):
        low = RateLimits(share * LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
        with pytest.raises(InputError, match=f"joint '.*' .*{what} .*limit.*slowed") as caught:
            Follower(MOTION, SimulatedLink(ROBOT, PATH.start), limits=low)
        assert "\n" not in str(caught.value)
    jumping = time_parameterize(PATH, RateLimits(LIMITS.velocity, LIMITS.acceleration))
    with pytest.raises(InputError, match="has a jerk of inf"):
        Follower(jumping, SimulatedLink(ROBOT, PATH.start), limits=LIMITS)
    peaks = MOTION.peaks()
    link = SimulatedLink(ROBOT, PATH.start)
    follower = Follower(MOTION, link, limits=RateLimits(*(row * (1.0 - 5e-7) for row in peaks)))  # as files round them
    for _ in range(5):
        follower.step(TICK)
    follower.stop()
    while not follower.ended:
        follower.step(TICK)
    assert not follower.result.arrived


@pytest.mark.parametrize("limits", [None, RateLimits(1.0, 0.05, 0.5)])
def test_an_arm_that_brakes_slowly_stops_and_goes_on_too(limits):
    slow = RateLimits(1.0, 0.05, 0.5)  # 20 s to its full speed
    path = JointPath(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]))
    motion = time_parameterize(path, slow)
    for moment in (10.0, 25.0, 40.0):
        link = PlainLink(path.start)
        follower = Follower(motion, link, limits=limits)
        while follower.result.seconds < moment:
            follower.step(0.05)
        follower.pause()
        before = follower.result.seconds
        while follower.result.seconds < before + 60.0:
            follower.step(0.05)
        assert follower.place < motion.duration
        here = follower.place
        follower.step(1.0)
        assert follower.place == here
        follower.resume()
        while not follower.ended and follower.result.seconds < 1000.0:
            follower.step(0.05)
        assert follower.result.arrived


class PlainLink:
    """An arm of any number of joints that is where it is told to be."""

    def __init__(self, q):
        self.q = q

    def positions(self):
        return self.q

    def command(self, q, t):
        self.q = q


def test_a_stop_that_comes_too_late_says_so():
    follower, _ = follower_at()
    while follower.place < MOTION.duration - 0.05:
        follower.step(TICK)
    follower.stop("a hand in the way")
    while not follower.ended:
        follower.step(TICK)
    assert follower.result.arrived
    assert follower.result.reason.startswith("a hand in the way: too late")


def test_set_points_do_not_jump_after_a_tick_that_comes_late():
    now, ticks, rate = [0.0], [0], 125.0

    def sleep(seconds):
        ticks[0] += 1
        now[0] += 0.6 if ticks[0] in (40, 90) else max(seconds, 1e-4)

    follower, link = follower_at(rate=rate)
    found = follower.run(clock=lambda: now[0], sleep=sleep)
    assert found.arrived
    rows = np.array([PATH.start, *(q for _, q in link.sent)])
    assert (np.abs(np.diff(rows, axis=0)) <= 3.0 / rate * LIMITS.velocity * (1.0 + 1e-9)).all()
    assert found.late == pytest.approx(2 * (0.6 - 3.0 / rate), abs=0.02)
    assert found.seconds == pytest.approx(MOTION.duration, abs=0.03)
    assert now[0] == pytest.approx(found.seconds + found.late, abs=1e-9)


def test_what_cannot_be_followed_is_refused_in_one_line():
    with pytest.raises(InputError, match="move the arm there first") as caught:
        follower_at(start=[1.0, 0.0, 0.0])
    assert "\n" not in str(caught.value)
    other = load_robot("planar6")
    with pytest.raises(InputError, match="another robot"):
        Follower(MOTION, SimulatedLink(other, np.zeros(6)))
    with pytest.raises(InputError, match="trajectory to follow"):
        Follower(PATH, SimulatedLink(ROBOT, PATH.start))
    for arm in (None, ROBOT, SimulatedLink):
        with pytest.raises(InputError, match="arm of a follower"):
            Follower(MOTION, arm)
    for here in (None, "home", [[0.0] * 3], [np.nan] * 3):
        with pytest.raises(InputError, match="positions of the arm"):
            Follower(MOTION, PlainLink(here))
    moving = Trajectory([0.0, 1.0], [[0.0] * 3, [0.1] * 3], [[0.1] * 3, [0.1] * 3])
    with pytest.raises(InputError, match=r"start.*at rest"):
        Follower(moving, PlainLink(np.zeros(3)))
    for rate in (0.0, np.nan):
        with pytest.raises(InputError, match="rate"):
            follower_at(rate=rate)
    follower, _ = follower_at()
    for pace in (0.0, 1.5, np.nan, "fast"):
        with pytest.raises(InputError, match="pace"):
            follower.pace(pace)


def test_the_arms_of_the_pilot_follow_too():
    arm = SimulatedArm(ROBOT, PATH.start, rates=[5.0] * 3)
    follower = Follower(MOTION, ArmLink(arm), limits=LIMITS)
    while not follower.ended:
        follower.step(0.01)
        arm.advance(0.01)
    assert np.allclose(arm.read(), PATH.end, atol=1e-9)
    with LineServer(SimulatedArm(ROBOT, PATH.end, rates=[5.0] * 3)) as server:
        client = LineArm(ROBOT, "127.0.0.1", server.port)
        link = ArmLink(client)
        link.command(PATH.end + 0.01, 0.0)
        until(lambda: np.abs(link.positions() - PATH.end - 0.01).max() < 1e-9)
        assert np.allclose(server.arm.read(), PATH.end + 0.01)
        client.close()
