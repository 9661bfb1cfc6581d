"""The tree that ``plan(tree=True)`` keeps: free motions, in the order in which they grew; the plan is the same."""

import numpy as np
import pytest

import rrtik_ompl as rrtik

pytestmark = pytest.mark.kernels


def planned(name, planner, **options):
    return rrtik.plan(rrtik.load_problem(name), planner, seed=1, seconds=60.0, **options)


def free_in_steps(world, a, b):
    """Whether the arm is free at points of a motion, by exact checks of one after the other."""
    return all(world.valid(a + share * (b - a)) for share in np.linspace(0.0, 1.0, 9))


def is_connected_all_along(tree):
    """Whether each edge, when it comes, has an end in what has grown before; zero-length edges join two trees."""
    grown = {*tree.starts.tolist(), *tree.goals.tolist()}
    for step in np.unique(tree.steps):
        waiting = [tuple(edge) for edge in tree.edges[tree.steps == step].tolist()]
        while waiting:
            fitting = [edge for edge in waiting if grown & set(edge)]
            if not fitting:
                return False
            grown.update(*fitting)
            waiting = [edge for edge in waiting if edge not in fitting]
    return True


@pytest.mark.parametrize(
    ("name", "planner"),
    [
        ("planar3_boxes", "crdt"),
        ("planar3_boxes", "bicrdt"),
        ("planar3_boxes", "fastrrtconnect"),
        ("planar3_boxes", "RRTConnect"),
        ("planar3_boxes", "RRT"),
        ("panda_upright", "cbirrt"),
    ],
)
def test_the_tree_grows_by_free_motions_from_its_roots(name, planner):
    plan = planned(name, planner, tree=True)
    tree = plan.tree
    assert tree.planner == planner
    assert len(tree.edges) > 3
    assert (np.diff(tree.steps) >= 0).all()
    assert is_connected_all_along(tree)
    problem = plan.problem
    assert (tree.vertices[tree.starts] == problem.start).all(axis=1).any()
    chosen = np.random.default_rng(0).choice(len(tree.edges), min(len(tree.edges), 20), replace=False)
    world = problem.world.unheld if problem.constraints else problem.world
    assert all(free_in_steps(world, *tree.vertices[edge]) for edge in tree.edges[chosen])
    if planner in ("crdt", "bicrdt"):
        moved = (tree.vertices[tree.edges[:, 0]] != tree.vertices[tree.edges[:, 1]]).sum(axis=1)
        assert (moved == 1).all()


@pytest.mark.parametrize("planner", ["crdt", "fastrrtconnect", "RRTConnect", "roadmap"])
def test_the_plan_is_the_same_with_and_without_its_tree_and_the_tree_each_time(planner):
    plain = planned("planar3_boxes", planner)
    one, other = (planned("planar3_boxes", planner, tree=True) for _ in range(2))
    assert plain.tree is None
    assert np.array_equal(plain.path.waypoints, one.path.waypoints)
    for part in ("vertices", "edges", "steps", "starts", "goals"):
        assert np.array_equal(getattr(one.tree, part), getattr(other.tree, part))


def test_the_planners_own_path_runs_along_its_tree():
    plan = planned("planar3_boxes", "crdt", tree=True, shorten=False)
    edges = {frozenset(map(tuple, plan.tree.vertices[edge].tolist())) for edge in plan.tree.edges}
    reached = {point for edge in edges for point in edge}
    assert {tuple(row) for row in plan.path.waypoints.tolist()[:-1]} <= reached


def test_links_of_mb_rrt_are_as_long_as_those_of_the_arm():
    plan = planned("titan4_axis1", "mbrrt", tree=True)
    robot = plan.problem.robot
    assert len(plan.tree.links) == robot.dof
    origins = robot.joint_frames(robot.clamp(np.zeros(robot.dof))[None])[0, 1:, :3, 3]
    wanted = np.linalg.norm(np.diff([*origins, robot.fk(np.zeros(robot.dof)).translation], axis=0), axis=1)
    for links, length in zip(plan.tree.links, wanted, strict=True):
        assert len(links) > 0
        assert np.allclose(np.linalg.norm(links[:, 1] - links[:, 0], axis=1), length, atol=1e-9)


def test_joint_weights_leave_the_tree_in_joint_values():
    problem = rrtik.load_problem("planar3_boxes")
    heavy = rrtik.load_robot("planar3", parameters={"radius": 0.02}, joint_weights={"joint2": 5.0})
    asked = rrtik.Problem(rrtik.World(heavy, problem.world.scene), problem.start, problem.goal)
    tree = rrtik.plan(asked, "RRTConnect", seed=1, tree=True).tree
    assert (tree.vertices[tree.starts] == problem.start).all(axis=1).any()
    assert ((tree.vertices >= heavy.lower - 1e-9) & (tree.vertices <= heavy.upper + 1e-9)).all()


def test_planners_that_keep_none_have_none_and_what_is_no_answer_is_refused():
    assert planned("planar3_boxes", "fewest-moves", tree=True).tree is None
    with pytest.raises(rrtik.InputError, match="tree"):
        rrtik.plan(rrtik.load_problem("planar3_boxes"), tree="yes")
