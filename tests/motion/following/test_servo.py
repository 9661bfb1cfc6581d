"""The tip steered by its velocity: it goes where it is told, stays in the joints' ranges, touches nothing."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.motion.following.servo import METHODS, Servo
from rrtik_ompl.world.world import World

DT = 0.01


@pytest.fixture(scope="module")
def panda():
    return load_robot("panda")


@pytest.fixture(scope="module")
def cluttered(panda):
    places = ([0.55, 0.25, 0.5], [0.5, -0.3, 0.45], [0.35, 0.0, 0.85], [0.75, 0.0, 0.4])
    balls = [Obstacle(f"ball{k}", Sphere(0.08), pin.SE3(np.eye(3), np.array(p))) for k, p in enumerate(places)]
    table = Obstacle("table", Box([1.0, 1.0, 0.1]), pin.SE3(np.eye(3), np.array([0.7, 0.0, 0.0])))
    return World(panda, Scene([*balls, table]))


def tip(robot, q):
    return robot.fk_batch(q[None])[0]


@pytest.mark.parametrize("method", METHODS)
def test_the_tip_moves_as_it_is_told(panda, method):
    servo, q = Servo(World(panda), method), panda.posture("default")
    before = tip(panda, q)
    for _ in range(50):
        q = q + DT * servo.step(q, [0.05, -0.03, 0.04, 0.0, 0.0, 0.1], DT)
    after = tip(panda, q)
    assert np.allclose(after[:3, 3] - before[:3, 3], 0.5 * np.array([0.05, -0.03, 0.04]), atol=1e-3)
    turn = pin.log3(after[:3, :3] @ before[:3, :3].T)
    assert np.allclose(turn, [0.0, 0.0, 0.05], atol=2e-3)


@pytest.mark.parametrize("method", METHODS)
def test_rates_and_ranges_of_joints_are_kept_and_nothing_is_touched(panda, cluttered, method):
    rng = np.random.default_rng(7)
    servo, q = Servo(cluttered, method, centring=0.2), panda.posture("default")
    moved = 0.0
    for _ in range(60):
        twist = rng.normal(size=6) * [0.4, 0.4, 0.4, 1.0, 1.0, 1.0]
        for _ in range(15):
            rates = servo.step(q, twist, DT)
            assert (np.abs(rates) <= panda.velocity * (1 + 1e-9)).all()
            q = q + DT * rates
            moved += float(np.abs(DT * rates).sum())
            assert panda.within_limits(q[None]).all()
            assert cluttered.valid(q), cluttered.explain(q)
    assert moved > 5.0  # it does not just stand still


def test_a_tip_that_is_sent_into_an_obstacle_slows_down_and_stays_apart(panda):
    wall = Obstacle("wall", Box([0.1, 2.0, 2.0]), pin.SE3(np.eye(3), np.array([0.75, 0.0, 0.6])))
    world = World(panda, Scene([wall]))
    servo, q = Servo(world, near=0.08), panda.posture("default")

    def speed(push):
        rates = servo.step(q, [push, 0.0, 0.0, 0.0, 0.0, 0.0], DT)
        return rates, (tip(panda, q + DT * rates)[0, 3] - tip(panda, q)[0, 3]) / DT

    assert speed(0.2)[1] == pytest.approx(0.2, abs=0.01)
    for _ in range(400):
        q = q + DT * speed(0.2)[0]
    assert 0.0 < world.clearance(q) < 0.05
    assert abs(speed(0.2)[1]) < 0.02
    assert speed(-0.2)[1] < -0.05  # it gets free again


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_near_an_obstacle_the_tip_keeps_its_direction(panda, method, tilt):
    turn = pin.utils.rotate("y", tilt)
    wall = Obstacle("wall", Box([0.1, 2.0, 2.0]), pin.SE3(turn, np.array([0.75, 0.0, 0.6])))
    world = World(panda, Scene([wall]))
    servo, q = Servo(world, method, near=0.08), panda.posture("default")
    before, slow = tip(panda, q)[:3, 3], 0.0
    for _ in range(400):
        rates = servo.step(q, [0.2, 0.0, 0.0, 0.0, 0.0, 0.0], DT)
        slow = float(np.abs(rates).max())
        q = q + DT * rates
    way = tip(panda, q)[:3, 3] - before
    assert world.clearance(q) < 0.02
    assert slow < 1e-2
    assert way[0] > 0.03
    assert np.abs(way[1:]).max() < 0.02 * way[0]
    sliding = Servo(world, method, near=0.08, slide=True)
    for _ in range(100):
        q = q + DT * sliding.step(q, [0.2, 0.0, 0.0, 0.0, 0.0, 0.0], DT)
        assert world.valid(q)
    gone = tip(panda, q)[:3, 3] - before - way
    assert np.abs(gone[1:]).max() > 0.01


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_secondary_task_yields_to_obstacles_first(panda, axis, sign):
    """Centring leads the elbow to a post; the tip goes on as it would without."""
    q = panda.posture("default") + np.array([0.6, 0.3, -0.5, 0.2, 0.4, 0.0, 0.3])
    post = Obstacle("post", Sphere(0.03), pin.SE3(np.eye(3), np.array([-0.052, 0.088, 0.667])))
    world = World(panda, Scene([post]))
    twist, servo = sign * 0.05 * np.eye(6)[axis], Servo(world, near=0.08, centring=2.0)
    before = tip(panda, q)
    for _ in range(60):
        q = q + DT * servo.step(q, twist, DT)
    assert world.clearance(q) < 0.06
    assert np.allclose(tip(panda, q)[:3, 3] - before[:3, 3], 0.6 * twist[:3], atol=2e-3)


def test_secondary_tasks_use_what_the_tip_leaves_free(panda):
    middle = 0.5 * (panda.lower + panda.upper)
    q = panda.posture("default") + np.array([0.6, 0.3, -0.5, 0.2, 0.4, 0.0, 0.3])
    for options, better in (
        ({"centring": 1.0}, lambda q: -np.linalg.norm(q - middle)),
        ({"manipulability": 5.0}, Servo(World(panda))._volume),
    ):
        servo, here = Servo(World(panda), **options), q
        before = tip(panda, here)
        for _ in range(100):
            here = here + DT * servo.step(here, np.zeros(6), DT)
        assert np.allclose(tip(panda, here), before, atol=5e-3)
        assert better(here) > better(q)


def test_the_tip_drifts_with_the_square_of_a_step_of_secondary_tasks(panda):
    q = panda.posture("default") + np.array([0.6, 0.3, -0.5, 0.2, 0.4, 0.0, 0.3])
    rates = Servo(World(panda), centring=0.3).step(q, np.zeros(6), 1e-3)
    assert np.linalg.norm(rates) > 0.05
    drifts = [np.linalg.norm(tip(panda, q + h * rates) - tip(panda, q)) for h in (0.1, 0.05)]
    assert drifts[0] / drifts[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda w: Servo(w, "fast"), "method of a servo"),
        (lambda w: Servo(w.robot), "world of a servo"),
        (lambda w: Servo(w, near=0.01, kept=0.02), "less than near"),
        (lambda w: Servo(w, centring=-1.0), "centring"),
        (lambda w: Servo(w, centring=np.nan), "centring"),
        (lambda w: Servo(w, near=None), "near"),
        (lambda w: Servo(w, kept="a"), "kept"),
        (lambda w: Servo(w, slide=1), "slide"),
        (lambda w: Servo(None), "world of a servo"),
        (lambda w: Servo(w, None), "method of a servo"),
        (lambda w: Servo(w).step(None, np.zeros(6), 0.01), "configuration of a servo"),
        (lambda w: Servo(w).step([], np.zeros(6), 0.01), "configuration of a servo"),
        (lambda w: Servo(w).step(np.zeros(7), "up", 0.01), "twist"),
        (lambda w: Servo(w).step(np.zeros(7), np.zeros(6), None), "time step"),
        (lambda w: Servo(w).step(np.zeros(7), np.zeros(6), np.inf), "time step"),
        (lambda w: Servo(w).step(np.zeros(3), np.zeros(6), 0.01), "configuration of a servo"),
        (lambda w: Servo(w).step(np.zeros(7), np.zeros(3), 0.01), "twist"),
        (lambda w: Servo(w).step(np.zeros(7), np.full(6, np.nan), 0.01), "twist"),
        (lambda w: Servo(w).step(np.zeros(7), np.zeros(6), 0.0), "time step"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(panda, call, words):
    with pytest.raises(InputError, match=words) as caught:
        call(World(panda))
    assert "\n" not in str(caught.value)
