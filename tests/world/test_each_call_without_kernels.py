"""Every public call that is given a world or a problem: without kernels it gives the answer that it gives with them."""

import inspect
import re

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Box, Obstacle, Scene, World, pose
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.kernels.simd import library
from rrtik_ompl.replanning import Scenario, plan_in_time
from rrtik_ompl.replanning.settings import ReplanSettings

START = np.array([0.3, 0.2, 0.1])
GOAL = np.array([1.9, -0.3, 0.2])
ROWS = np.random.default_rng(0).uniform(-2.0, 2.0, (40, 3))
LINE = np.linspace(START, [0.4, 0.25, 0.0], 3)
MANNERS = {"seed": 0, "seconds": 30.0}


def problem_of_an_arm(goal=GOAL):
    """A planar arm beside a box, made anew: worlds of equal values share their kernels."""
    box = Obstacle("box", Box([0.5, 0.5, 0.5]), pose([1.4, 1.4, 0.0]))
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.02})
    return rrtik.Problem(World(robot, Scene([box])), START, goal)


def tip_of(problem, q=START, by=(0.0, 0.0, 0.0)):
    return problem.robot.fk(q).translation + by


def path_of(problem, rows=LINE):
    return rrtik.JointPath.of(problem.robot, rows)


def near(problem):
    """The same problem with a goal beside the start."""
    return rrtik.Problem(problem.world, START, LINE[-1])


def planned(problem, *args, **options):
    plan = rrtik.plan(problem, *args, seed=0, seconds=30.0, **options)
    return plan.found, plan.proven, plan.reason


def motion_of(found):
    return found.found, found.proven, found.reason


def roadmap_of(problem):
    return rrtik.Roadmap(problem.world, vertices=12)


def roadmap_path(roadmap):
    return roadmap.path(START, LINE[-1], seconds=30.0) is not None


def roadmap_found(problem, _):
    return roadmap_path(roadmap_of(problem))


def task_of(problem):
    return rrtik.Task([rrtik.MoveTo(LINE[-1]), rrtik.Straight(by=[0.0, -0.1, 0.0])], problem.world, START)


def held(problem):
    return rrtik.Problem(problem.world, START, LINE[-1], constraints=[rrtik.constraints.upright(problem.robot)])


def task_planned(problem, _):
    return motion_of(task_of(problem).plan(**MANNERS))


def varied_task_planned(problem, _):
    return motion_of(task_of(problem).varied(rrtik.Variation(start=START)).plan(**MANNERS))


def timed(problem):
    return rrtik.time_parameterize(path_of(problem), problem.robot)


def run_of(problem):
    return rrtik.replan(near(problem), step=0.2, rate=5.0, repair_budget=30.0, **MANNERS)


def certificate_fault(problem, _):
    path = path_of(problem)
    return problem.world.verify(problem.world.certificate(path), path.waypoints)


def saved_roadmap(problem, folder):
    roadmap_of(problem).save(folder / "map.npz")
    return roadmap_path(rrtik.Roadmap.load(folder / "map.npz", problem.world))


def saved_task(problem, folder):
    task_of(problem).save(folder / "task.yaml")
    return motion_of(rrtik.Task.load(folder / "task.yaml").plan(**MANNERS))


def first_rates(problem):
    rates = rrtik.following.Servo(problem.world).step(START, [0.0, 0.05, 0.0, 0.0, 0.0, 0.0], 0.01)
    return np.round(rates, 6)


def run_certificate_fault(problem, _):
    run = run_of(problem)
    certificate = run.certificate(problem.world)
    return certificate is None or run.verify(certificate, problem.world)


def grasping():
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.02), [0.5, 0.0, 0.4])
    return rrtik.World(rrtik.load_robot("panda_primitives"), rrtik.Scene([ball]))


ENGINES = {"World", "Roadmap", "Task"}  # of which all methods are tried
MERE_VALUES = {"Plan", "TaskPlan", "World"}
CALLS = {
    "Problem": lambda p, _: p.goal.q,
    "Problem.with_world": lambda p, _: planned(near(p).with_world(p.world.with_clearance(0.01))),
    "Roadmap": roadmap_found,
    "Roadmap.grow": lambda p, _: roadmap_of(p).grow(20) > 12,
    "Roadmap.path": roadmap_found,
    "Roadmap.route": lambda p, _: roadmap_of(p).route(START[None], LINE[-1:], lambda: False) is not None,
    "Roadmap.learn": lambda p, _: roadmap_of(p).learn(LINE),
    "Roadmap.moved_to": lambda p, _: roadmap_path(roadmap_of(p).moved_to(p.world.moved("box", pose([1.5, 1.5, 0.0])))),
    "Roadmap.save": saved_roadmap,
    "Roadmap.load": saved_roadmap,
    "Task": task_planned,
    "Task.plan": task_planned,
    "Task.plan_many": lambda p, _: motion_of(task_of(p).plan_many([rrtik.Variation()], threads=1)[0]),
    "Task.varied": varied_task_planned,
    "Task.save": saved_task,
    "Task.load": saved_task,
    "JointPath.violations": lambda p, _: path_of(p).violations(p.world),
    "JointPath.proved": lambda p, _: path_of(p).proved(p.world).proven,
    "JointPath.played": lambda p, _: path_of(p).played(p.world).judged.verdict.text,
    "JointPath.proven_in": lambda p, _: path_of(p).proved(p.world).proven_in(p.world),
    "prove": lambda p, _: rrtik.prove(p.world, path_of(p)).status,
    "Trajectory.save": lambda p, folder: timed(p).save(folder / "motion.yaml", world=p.world),
    "Trajectory.faults": lambda p, _: timed(p).faults(p.world),
    "Trajectory.prove": lambda p, _: timed(p).prove(p.world).proven,
    "Trajectory.played": lambda p, _: timed(p).played(p.world).judged.verdict.text,
    "World.of": lambda p, _: World.of(p.world.settings).valid_batch(ROWS),
    "World.with_scene": lambda p, _: p.world.with_scene(Scene()).valid_batch(ROWS),
    "World.with_accuracy": lambda p, _: p.world.with_accuracy("conservative").motion_valid_batch(LINE[:-1], LINE[1:]),
    "World.with_resolution": lambda p, _: p.world.with_resolution(0.05).motion_valid_batch(ROWS[:-1], ROWS[1:]),
    "World.with_clearance": lambda p, _: p.world.with_clearance(0.03).valid_batch(ROWS),
    "World.proving": lambda p, _: p.world.proving().motion_valid_batch(ROWS[:-1], ROWS[1:]),
    "World.moved": lambda p, _: p.world.moved("box", pose([1.5, 1.0, 0.0])).valid_batch(ROWS),
    "World.with_obstacle": lambda p, _: p.world.with_obstacle(
        Obstacle("box", Box(0.3, 0.2, 0.4), pose([1.5, 1.0, 0.0]))
    ).valid_batch(ROWS),
    "World.valid": lambda p, _: p.world.valid(ROWS[0]),
    "World.valid_batch": lambda p, _: p.world.valid_batch(ROWS),
    "World.motion_valid": lambda p, _: p.world.motion_valid(START, GOAL),
    "World.motion_valid_batch": lambda p, _: p.world.motion_valid_batch(ROWS[:-1], ROWS[1:]),
    "World.motion_proven": lambda p, _: p.world.motion_proven(LINE[0], LINE[1]),
    "World.motions_proven": lambda p, _: p.world.motions_proven(ROWS[:-1], ROWS[1:]),
    "World.prove": lambda p, _: [gap.motion for gap in p.world.prove(ROWS[:9]).unproven],
    "World.certificate": certificate_fault,
    "World.verify": certificate_fault,
    "World.has_proven": lambda p, _: p.world.has_proven(p.world.prove(LINE)),
    "World.violations": lambda p, _: [(each.edge, each.reason) for each in p.world.violations(ROWS[:9])],
    "World.judged": lambda p, _: p.world.judged(LINE).verdict.text,
    "World.steps": lambda p, _: p.world.steps(START, GOAL),
    "World.contacts": lambda p, _: [len(p.world.contacts(row)) for row in ROWS],
    "World.closest": lambda p, _: [getattr(p.world.closest(row), "second", "") for row in ROWS],
    "World.clearance": lambda p, _: [round(p.world.clearance(row), 6) for row in ROWS],
    "World.distances": lambda p, _: p.world.distances(ROWS).values.round(4).tolist(),
    "World.too_near": lambda p, _: [len(p.world.with_clearance(0.05).too_near(row)) for row in ROWS],
    "World.explain": lambda p, _: [p.world.explain(row) for row in ROWS],
    "World.certify": lambda p, _: p.world.certify(ROWS),
    "following.Servo": lambda p, _: first_rates(p),
    "gym.Reach": lambda p, _: rrtik.gym.Reach(p.world).reset(seed=1)[0].round(6),
    "grasps": lambda p, _: [round(grasp.width, 4) for grasp in rrtik.grasps(grasping(), "ball", count=1)],
    "ik.reach_map": lambda p, _: rrtik.ik.reach_map(p.robot, world=p.world, cell=0.5, samples=2000).reached.sum(),
    "ik.solve_trajectory": lambda p, _: rrtik.ik.solve_trajectory(p.robot, p.robot.fk_batch(LINE), world=p.world).found,
    "ompl.GoalSampler": lambda p, _: len(rrtik.ompl.GoalSampler(p).rows),
    "ompl.RegionConstraint": lambda p, _: rrtik.ompl.RegionConstraint(held(p)).getManifoldDimension(),
    "ompl.simple_setup": lambda p, _: bool(rrtik.ompl.simple_setup(p).solve(5.0)),
    "ompl.space_information": lambda p, _: rrtik.ompl.space_information(p.world).getStateDimension(),
    "one_joint_moves": lambda p, _: rrtik.one_joint_moves(path_of(p), p).proven,
    "plan": lambda p, _: planned(p),
    "plan to a tip goal": lambda p, _: planned(problem_of_an_arm(rrtik.PositionGoal(tip_of(p, LINE[-1])))),
    "plan along constraints": lambda p, _: planned(held(p)),
    "plan with fewest moves": lambda p, _: planned(near(p), "fewest-moves"),
    "plan with OMPL": lambda p, _: planned(near(p), "RRTConnect"),
    "plan and improve": lambda p, _: planned(near(p), improve=0.1),
    "plan_many": lambda p, _: [motion_of(each) for each in rrtik.plan_many(p.world, LINE[:2], LINE[1:], **MANNERS)],
    "replan": lambda p, _: run_of(p).found,
    "replanning.ReplanRun.certificate": run_certificate_fault,
    "replanning.ReplanRun.verify": run_certificate_fault,
    "replanning.ReplanRun.violations": lambda p, _: run_of(p).violations(p),
    "replanning.ReplanRun.judged": lambda p, _: run_of(p).judged(p).verdict.text,
    "replanning.Scenario": lambda p, _: (
        Scenario(near(p), ReplanSettings(step=0.2, rate=5.0, repair_budget=30.0)).run().found
    ),
    "replanning.plan_in_time": lambda p, _: motion_of(plan_in_time(near(p), seed=0, horizon=20.0, rate=5.0)),
    "shorten": lambda p, _: rrtik.shorten(path_of(p, [START, [0.5, 0.0, 0.0], START + 0.1]), p).length,
    "solve_ik": lambda p, _: rrtik.solve_ik(p.robot, rrtik.PositionGoal(tip_of(p)), world=p.world).found,
    "solve_ik_many": lambda p, _: rrtik.solve_ik_many(p.robot, p.robot.fk_batch(LINE), world=p.world).found,
    "time_parameterize": lambda p, _: round(
        rrtik.time_parameterize(path_of(p), p.robot, blend=0.01, world=p.world).duration, 6
    ),
    "time_parameterize_many": lambda p, _: round(
        rrtik.time_parameterize_many([path_of(p)], p.robot, blend=0.01, world=p.world)[0].duration, 6
    ),
    "tip.arc": lambda p, _: motion_of(
        rrtik.tip.arc(p.world, START, tip_of(p, by=[-0.1, 0.1, 0.0]), tip_of(p, by=[-0.02, 0.08, 0.0]))
    ),
    "tip.follow": lambda p, _: motion_of(rrtik.tip.follow(p.world, START, p.robot.fk_batch(LINE))),
    "tip.screw": lambda p, _: motion_of(rrtik.tip.screw(p.world, START, p.robot.fk(START + 0.05))),
    "tip.straight": lambda p, _: motion_of(rrtik.tip.straight(p.world, START, tip_of(p, by=(0.0, 0.05, 0.0)))),
}


def public_calls():
    """Names of the public functions, constructors and methods that are given a world or a problem, or belong to one."""
    for name, value in dict(public_values(rrtik)).items():
        if inspect.isfunction(value) and is_given_a_world(value):
            yield name
        if inspect.isclass(value):
            for method, function in vars(value).items():
                function = getattr(function, "__func__", function)
                if not inspect.isfunction(function) or not (name in ENGINES or is_given_a_world(function)):
                    continue
                if method == "__init__":
                    yield name
                elif not method.startswith("_"):
                    yield f"{name}.{method}"


def is_given_a_world(function):
    arguments = inspect.signature(function).parameters.values()
    return any(re.search(r"\b(World|Problem|Judge)\b", str(each.annotation)) for each in arguments)


def test_each_public_call_that_is_given_a_world_is_tried():
    assert set(public_calls()) - set(CALLS) == MERE_VALUES


@pytest.mark.kernels
@pytest.mark.parametrize("name", {call: name for name, call in CALLS.items()}.values())
def test_the_answer_without_kernels_is_that_of_the_kernels(name, monkeypatch, tmp_path):
    by_kernels = CALLS[name](problem_of_an_arm(), tmp_path)
    monkeypatch.setenv(library.SWITCH, "0")
    monkeypatch.setattr(library, "_libraries", {})
    problem = problem_of_an_arm()
    assert problem.world.fast is None
    np.testing.assert_equal(CALLS[name](problem, tmp_path), by_kernels)
