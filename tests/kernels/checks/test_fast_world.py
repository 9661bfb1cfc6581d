"""The answers of FastWorld: for any number of rows, any layout of arrays, and with one line for bad values."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import FREE, UNDECIDED, FastWorld, needs_covers
from rrtik_tests.random_cases import KINDS, Case, arm, joint_values, random_solid

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("name", ["titan4", "panda", "slider"])
def test_undecided_pairs_are_all_those_whose_outer_spheres_touch(name):
    for seed in range(4):
        case = Case(name, seed, kinds=[k for k in KINDS if k != "round convex"])
        Q = case.sample(100)
        touching = case.meetings(Q, case.outer, inner=False)
        nearly = case.meetings(Q, case.outer, inner=False, grow=3.0 * case.world.margin + 1e-4)
        for q, sure, perhaps in zip(joint_values(case.robot, Q), touching, nearly, strict=True):
            found = case.world.undecided_pairs(q[None])[0]
            assert {case.pairs[k] for k in np.flatnonzero(sure)} <= set(found)
            assert set(found) <= {case.pairs[k] for k in np.flatnonzero(perhaps)}
            assert len(found) == len(set(found))


@pytest.mark.parametrize("name", ["titan4", "slider"])
def test_plain_numpy_gives_the_same_answers(name):
    case = Case(name, 5)
    plain = FastWorld(case.robot.chain, case.bodies, case.pairs, outer=case.outer, inner=case.inner, compiled=False)
    Q = case.sample(400)
    V = joint_values(case.robot, Q)
    ours, theirs = case.world.classify(V), plain.classify(V)
    assert ((ours == theirs) | (ours == UNDECIDED) | (theirs == UNDECIDED)).all()
    assert (ours == theirs).mean() > 0.99
    edges = case.world.classify_edges(V[:20], V[20:40], [9] * 20)
    others = plain.classify_edges(V[:20], V[20:40], [9] * 20)
    assert ((edges == others) | (edges == UNDECIDED) | (others == UNDECIDED)).all()
    for v in V[:50]:
        assert set(case.world.undecided_pairs(v[None])[0]) == set(plain.undecided_pairs(v[None])[0])


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 15, 16, 17, 1000])
def test_any_number_of_rows_is_judged_row_by_row(count):
    case = Case("titan4", 2)
    V = joint_values(case.robot, case.sample(count))
    answers = case.world.classify(V)
    assert answers.shape == (count,)
    assert answers.dtype == np.int8
    np.testing.assert_array_equal(answers, [case.world.classify(v[None])[0] for v in V])
    edges = case.world.classify_edges(V, V[::-1], np.full(count, 5))
    alone = [case.world.classify_edges(a[None], b[None], [5])[0] for a, b in zip(V, V[::-1], strict=True)]
    np.testing.assert_array_equal(edges, alone)


def test_the_layout_of_the_array_does_not_matter():
    case = Case("titan4", 2)
    V = joint_values(case.robot, case.sample(100)).astype(np.float32).astype(np.float64)
    expected = case.world.classify(V)
    fixed = V.copy()
    fixed.setflags(write=False)
    for same in (fixed, np.asfortranarray(V), np.repeat(V, 2, axis=0)[::2], V[::-1][::-1], V.astype(np.float32)):
        np.testing.assert_array_equal(case.world.classify(same), expected)
    np.testing.assert_array_equal(case.world.classify(V.tolist()), expected)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(bad):
    case = Case("titan4", 2)
    V = np.zeros((20, 6))
    V[13, 2] = bad
    for ask in (
        lambda: case.world.classify(V),
        lambda: case.world.classify_edges(np.zeros((20, 6)), V, np.ones(20)),
        lambda: case.world.undecided_pairs(V[13:15]),
    ):
        with pytest.raises(InputError, match="finite"):
            ask()


def test_arrays_of_the_wrong_shape_are_refused():
    case = Case("titan4", 2)
    for V in (np.zeros((3, 5)), np.zeros(6), np.zeros((1, 2, 6)), [["a"] * 6]):
        with pytest.raises(InputError):
            case.world.classify(V)
    with pytest.raises(InputError, match="as many starts as ends"):
        case.world.classify_edges(np.zeros((2, 6)), np.zeros((3, 6)), [1, 1])
    for counts in ([0, 1], [1.5, 2], [1], [-1, 1], [2**40, 1]):
        with pytest.raises(InputError, match="steps"):
            case.world.classify_edges(np.zeros((2, 6)), np.zeros((2, 6)), counts)


@pytest.mark.parametrize("strokes", [np.nan, -1.0, [1.0, 2.0]])
def test_strokes_that_are_no_lengths_are_refused(strokes):
    with pytest.raises(InputError, match="strokes"):
        FastWorld(arm("slider").chain, [], [], outer=[], inner=[], strokes=strokes)


def test_the_same_kernels_serve_every_arm_and_scene():
    assert Case("titan4", 2).world._kernels is Case("slider", 2).world._kernels is not None


def test_a_body_without_a_cover_is_its_bounding_ball_and_an_endless_one_is_never_free():
    chain = arm("titan4").chain
    ball = Body("wall", 0, pin.SE3(np.eye(3), np.array([50.0, 0, 0])), coal.Sphere(0.1), "obstacle")
    for solid, expected in ((coal.Box(0.1, 0.1, 0.1), FREE), (coal.Halfspace(np.array([0, 0, 1.0]), 0.0), UNDECIDED)):
        solid.computeLocalAABB()
        body = Body("thing", 3, pin.SE3.Identity(), solid, "attached")
        none = [np.zeros((0, 4))] * 2
        world = FastWorld(chain, [body, ball], [(0, 1)], outer=none, inner=none)
        assert world.classify(np.zeros((1, 6))).tolist() == [expected]


def test_a_world_without_pairs_is_free():
    world = FastWorld(arm("titan4").chain, [], [], outer=[], inner=[])
    assert world.classify(np.ones((20, 6))).tolist() == [FREE] * 20
    assert world.classify_edges(np.ones((2, 6)), np.zeros((2, 6)), [3, 40]).tolist() == [FREE] * 2
    assert world.undecided_pairs(np.zeros((1, 6))) == [[]]


def test_solids_with_a_formula_need_no_covers():
    for kind, expected in (("box", (False, False)), ("convex", (False, True)), ("mesh", (True, True))):
        solid = random_solid(kind, np.random.default_rng(0), 1.0)
        solid.computeLocalAABB()
        assert needs_covers(Body("x", 0, pin.SE3.Identity(), solid, "obstacle")) == expected
        assert needs_covers(Body("x", 1, pin.SE3.Identity(), solid, "link")) == (True, True)
