"""A camera that repeats its last picture shows no present: nothing moves on it, and that is said."""

import numpy as np
import pytest

from rrtik_ompl.pilot.interlock import STALE_SECONDS
from rrtik_ompl.pilot.perception import REPEATS
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_tests.pilot_session import refused

STEP = 0.1


@pytest.fixture
def engine():
    opened = open_session(SessionOptions("titan4_sdu"))
    yield opened.engine
    opened.close()


def run(engine, seconds, begin, **command):
    """Time passes, with a picture each step; when it ends."""
    for k in range(round(seconds / STEP)):
        engine.update(begin + k * STEP)
        if command:
            engine.execute(command, begin + k * STEP)
    return begin + seconds


def freeze(engine, noisy=True, **changed):
    """The camera gives its last picture again and again, with a new time each."""
    source = engine.perception.source
    latest = source.latest
    kept = source.latest()
    count = iter(range(10**6))
    source.latest = lambda: Picture(kept.pixels.copy(), kept.name, kept.time + next(count), noisy=noisy)
    return lambda: setattr(source, "latest", latest)


def test_a_picture_that_repeats_is_stale_after_half_a_second_and_stops_the_arm(engine):
    time = run(engine, 1.0, 0.0, name="jog", direction=1.0, press=1)
    assert engine.session.driving
    thaw = freeze(engine)
    time = run(engine, STALE_SECONDS + 3 * STEP, time, name="jog", direction=1.0, press=1)
    assert not engine.session.driving
    assert "stale" in engine.session.known.trouble
    assert engine.perception.lost == REPEATS
    there = engine.session.arm.read()
    time = run(engine, 0.5, time, name="jog", direction=1.0, press=2)
    assert np.array_equal(engine.session.arm.read(), there)
    assert refused(engine.session, "stale")
    thaw()
    run(engine, 0.2, time)
    assert engine.session.known.trouble == ""
    assert engine.perception.lost == ""


def test_a_single_picture_that_comes_twice_is_no_news(engine):
    time = run(engine, 0.3, 0.0)
    thaw = freeze(engine)
    time = run(engine, 0.2, time)
    thaw()
    run(engine, 0.2, time)
    assert engine.session.known.trouble == ""


def test_a_simulated_camera_before_a_still_arm_is_not_frozen(engine):
    run(engine, 2.0 * STALE_SECONDS, 0.0)
    assert engine.session.known.trouble == ""
    assert engine.perception.lost == ""


def test_a_computed_camera_without_noise_lives_by_the_times_of_its_pictures(engine):
    time = run(engine, 0.3, 0.0)
    freeze(engine, noisy=False)
    run(engine, 2.0 * STALE_SECONDS, time)
    assert engine.session.known.trouble == ""


def test_a_computed_picture_that_keeps_its_time_is_the_same_one():
    pixels = np.zeros((4, 4, 3), dtype=np.uint8)
    computed = [Picture(pixels, "a", time, noisy=False) for time in (0.0, 0.0, 1.0)]
    assert computed[1].repeats(computed[0])
    assert not computed[2].repeats(computed[0])
    assert Picture(pixels, "a", 1.0).repeats(Picture(pixels.copy(), "a", 0.0))
    assert not Picture(pixels + 1, "a", 0.0).repeats(Picture(pixels, "a", 0.0))
