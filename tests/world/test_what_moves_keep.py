"""Whatever moves in a world keeps what the world keeps: every function that makes motions, judged by coal alone."""

import inspect
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values

KEPT = 0.06  # [m]
HERE = np.array([0.0, -1.2, 1.4, -0.2, 1.6, 0.0])
THERE = np.array([1.6, -1.2, 1.4, -0.2, 1.6, 0.0])
ROUNDING = 1e-6  # [m]
SHARES = np.linspace(0.0, 1.0, 8)

UR5 = rrtik.load_robot("ur5")
LINE = pin.SE3(UR5.fk(HERE).rotation, np.add(UR5.fk(HERE).translation, [0.0, 0.3, 0.0]))
POST = np.add(UR5.fk(0.5 * (HERE + THERE)).translation, [0.0, 0.0, 0.3]), (0.06, 0.06, 0.8)
BLOCK = np.add(UR5.fk(HERE).translation, [0.06, 0.15, -0.018]), (0.06, 0.06, 0.06)  # some 3 cm beside the line
LIMITS = rrtik.RateLimits([1.0] * 6, [5.0] * 6)


def world(thing):
    place, size = thing
    return rrtik.World(UR5, rrtik.Scene([rrtik.Obstacle("thing", rrtik.Box(size), rrtik.pose(place))]))


WAYS = {
    "with_clearance": lambda free: free.with_clearance(KEPT),
    "proving": lambda free: free.proving(KEPT),
    "both": lambda free: free.with_clearance(0.5 * KEPT).proving(KEPT),
}


def across(kept):
    return rrtik.Problem(kept, HERE, THERE)


def path(kept):
    found = rrtik.plan(across(kept), seed=1)
    assert found.found, found.reason
    return found.path


def roadmap(kept):
    return rrtik.Roadmap(kept, vertices=300, seed=1).path(HERE, THERE)


def blended(kept, blend):
    motion = rrtik.time_parameterize(path(kept), LIMITS, blend=blend, world=kept)
    assert motion.faults(kept) == ()
    return motion(np.linspace(0.0, motion.duration, 120)).positions


def timed_task(kept):
    plan = rrtik.Task([rrtik.MoveTo(rrtik.JointGoal(THERE))]).plan(kept, HERE, seed=1)
    motion = plan.time_parameterize(blend=1.0).trajectory
    return motion(np.linspace(0.0, motion.duration, 120)).positions


def task(kept):
    plan = rrtik.Task([rrtik.MoveTo(rrtik.JointGoal(THERE))]).plan(kept, HERE, seed=1)
    return plan.require().waypoints


def straight_stage(kept):
    plan = rrtik.Task([rrtik.Straight(to=LINE)]).plan(kept, HERE, seed=1)
    return np.vstack([HERE, *(each.waypoints for each in plan.paths)])


def steered(kept):
    servo = rrtik.following.Servo(kept, near=0.1, kept=0.0)
    rows = [HERE]
    for _ in range(100):
        rows.append(rows[-1] + 0.02 * servo.step(rows[-1], [0.0, 0.2, 0.0, 0.0, 0.0, 0.0], 0.02))
    return np.array(rows)


def in_time(kept):
    made = rrtik.replanning.plan_in_time(across(kept), seed=1, rate=10.0, limits=LIMITS)
    return made.require().path.waypoints


ACROSS = {  # motions around a post between two configurations
    "plan": lambda kept: path(kept).waypoints,
    "plan_many": lambda kept: rrtik.plan_many(kept, [HERE], [THERE])[0].path.waypoints,
    "shorten": lambda kept: rrtik.shorten(path(kept), across(kept), seed=1).waypoints,
    "one_joint_moves": lambda kept: rrtik.one_joint_moves(path(kept), kept).waypoints,
    "Roadmap": lambda kept: roadmap(kept).waypoints,
    "time_parameterize": lambda kept: blended(kept, 0.3),
    "time_parameterize, all corners": lambda kept: blended(kept, 1.0),
    "TaskPlan.time_parameterize": timed_task,
    "Task": task,
    "plan_in_time": in_time,
    "replan": lambda kept: np.array([tick.q for tick in rrtik.replan(across(kept), seed=1, step=0.2, rate=10.0).ticks]),
}
ALONG = {  # motions of the tip past a post
    "straight": lambda kept: rrtik.tip.straight(kept, HERE, LINE).path.waypoints,
    "follow": lambda kept: rrtik.tip.follow(kept, HERE, [LINE]).path.waypoints,
    "arc": lambda kept: rrtik.tip.arc(kept, HERE, LINE, LINE.translation - [0.01, 0.2, 0.0]).path.waypoints,
    "screw": lambda kept: rrtik.tip.screw(kept, HERE, LINE).path.waypoints,
    "Straight": straight_stage,
    "Servo": steered,
}
STILL = {  # take a world or a problem, and make no motion
    "prove",
    *("view", "film", "picture", "plot_joints"),
    *("GoalSampler", "simple_setup", "space_information", "solve_ik", "solve_ik_many", "solve_trajectory"),
    *("grasps", "Reach", "time_parameterize_many"),
    *(
        "Problem",
        "World",
        "Plan",
        "TaskPlan",
        "without_robot",
        "reach_map",
        "Scenario",
        "BenchmarkNotes",
        "RegionConstraint",
    ),
}


def least(rows, thing):
    """The least distance of a moving link from a box on motions, by coal [m]."""
    model, links = UR5.model, UR5.collision
    data, placed = model.createData(), links.createData()
    place, size = thing
    box, there = coal.Box(*size), coal.Transform3s(np.eye(3), np.asarray(place))
    found = np.inf
    for a, b in pairwise(rows):
        for q in UR5.pinocchio_configuration(a + SHARES[:, None] * (b - a)):
            pin.updateGeometryPlacements(model, data, links, placed, q)
            for link, pose in zip(links.geometryObjects, placed.oMg, strict=True):
                if link.parentJoint:
                    here = coal.Transform3s(pose.rotation, pose.translation)
                    asked = coal.DistanceRequest(), coal.DistanceResult()
                    found = min(found, coal.distance(link.geometry, here, box, there, *asked))
    return found


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("verb", ACROSS)
def test_motions_between_configurations_keep_what_the_world_keeps(verb, way):
    assert least(ACROSS[verb](WAYS[way](world(POST))), POST) >= KEPT - ROUNDING


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("verb", ALONG)
def test_motions_of_the_tip_keep_what_the_world_keeps(verb, way):
    if verb == "Straight":  # it is the whole line or nothing
        assert not rrtik.Task([rrtik.Straight(to=LINE)]).plan(WAYS[way](world(BLOCK)), HERE, seed=1).found
    else:
        assert least(ALONG[verb](WAYS[way](world(BLOCK))), BLOCK) >= KEPT - ROUNDING


@pytest.mark.parametrize("verb", ALONG)
def test_without_a_clearance_the_tip_passes_the_post_nearer(verb):
    assert 0.0 < least(ALONG[verb](world(BLOCK)), BLOCK) < KEPT - 0.01


def test_every_function_that_takes_a_world_or_a_problem_is_looked_at():
    known = {verb.split(",")[0] for verb in (*ACROSS, *ALONG)} | STILL
    taking = set()
    for name, value in public_values(rrtik).items():
        if callable(value):
            annotations = {str(each.annotation) for each in inspect.signature(value).parameters.values()}
            if any("World" in each or "Problem" in each for each in annotations):
                taking.add(name.rpartition(".")[2])
    assert taking - known == set()


@pytest.mark.parametrize("way", WAYS)
def test_a_path_that_does_not_keep_it_has_violations(way):
    near = rrtik.tip.straight(world(BLOCK), HERE, LINE).path
    kept = WAYS[way](world(BLOCK))
    assert near.violations(world(BLOCK)) == ()
    assert near.violations(kept)
    assert not near.proven_in(kept)
    assert not near.proved(kept).proven
    assert rrtik.time_parameterize(near, LIMITS).faults(kept)
