"""Errors of the sources, the GRIM test, and figures drawn from what is measured."""

import re

import numpy as np
import pytest
from scipy.stats import t as student_t

from rrtik_bench.crdt.published import CRDT_TABLE, RRT_TABLE
from rrtik_bench.errata.grim import consistent, off
from rrtik_bench.errata.prints import level_link_4, listed_routes, printed_routes, undefined
from rrtik_bench.errata.statistics import left_out, points_of, welch
from rrtik_bench.errata.tables import statistics
from rrtik_bench.figures import ikurt as ikurt_figures
from rrtik_bench.figures.mb_rrt import FIGURES, first_directions
from rrtik_bench.ikurt_limits import WRIST, approach, outward_share
from rrtik_bench.registry import COLLECTION
from rrtik_bench.report.figures import PICTURE, Figure
from rrtik_bench.report.rows import exactly, judged
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.reproduce import page
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.published import grow
from rrtik_tests.places import ROOT


def test_a_mean_over_whole_numbers_is_a_fraction_of_their_number():
    rng = np.random.default_rng(0)
    for count in rng.integers(1, 101, 50).tolist():
        mean = round(float(np.mean(rng.integers(1, 10_000, count))), 4)
        assert off(mean, 4, count) <= 1.0 + 1e-6
    assert consistent(5074.6154, 4, 35) == [13, 26]
    assert consistent(5.4286, 4, 35) == [7, 14, 21, 28, 35]
    assert consistent(6.7844, 4, 35) == []
    assert 71 in consistent(1333.0282, 4, 100)


def test_welch_of_printed_numbers_is_that_of_samples_which_have_them():
    rng, count = np.random.default_rng(0), 1000
    samples = []
    for table in (RRT_TABLE, CRDT_TABLE):
        values = rng.exponential(size=count)
        samples.append(table[0][0] + table[3][0] * (values - values.mean()) / values.std(ddof=1))
    first, second = ((sample.mean(), sample.std(ddof=1)) for sample in samples)
    t, p = welch(first, second, count)
    squares = [sample.var(ddof=1) / count for sample in samples]
    by_hand = (samples[0].mean() - samples[1].mean()) / np.sqrt(sum(squares))
    freedom = sum(squares) ** 2 / (sum(square**2 for square in squares) / (count - 1))
    assert t == pytest.approx(by_hand, rel=1e-12)
    assert p == pytest.approx(2.0 * student_t.sf(t, freedom), rel=1e-6)
    assert t == pytest.approx(30.7, abs=0.05)


def test_equal_means_do_not_differ_more_often_than_by_chance():
    rng, tests = np.random.default_rng(0), 2000
    samples = rng.normal(0.0, [[[1.0]], [[3.0]]], (2, tests, 50))
    means, deviations = samples.mean(axis=2), samples.std(axis=2, ddof=1)
    p = [welch((means[0, k], deviations[0, k]), (means[1, k], deviations[1, k]), 50)[1] for k in range(tests)]
    assert 0.035 < np.mean(np.array(p) < 0.05) < 0.065


@pytest.mark.parametrize("reached", [1, 39, 47, 250])
@pytest.mark.parametrize("counted", [9_800, 10_000, 10_100])
def test_generations_left_out_are_those_that_make_a_quotient_right(reached, counted):
    least, most = left_out(10_000, reached, counted // reached)
    assert least <= 10_000 - counted <= most
    for missing in (least, most):
        assert (10_000 - missing) // reached == counted // reached
    assert (10_000 - least + 1) // reached != counted // reached != (10_000 - most - 1) // reached


def test_a_share_gives_the_points_that_were_reached():
    for number in range(252):
        assert number in points_of(round(100.0 * number / 251, 1), 251)
        assert number in points_of(int(1000.0 * number / 251) / 10, 251)


def test_printed_statistics_are_judged_against_each_other():
    rows = {row.name: row for row in statistics(True)}
    means = [row for name, row in rows.items() if name.startswith("tables 6.2")]
    counts = [row for name, row in rows.items() if name.startswith("[2, table 4]")]
    assert [row.verdict.value for row in means] == ["refuted"] * 4
    assert [row.verdict.value for row in counts] == ["differs"] * 4
    assert [row.value for row in counts] == [84, 120, 51, 17]
    assert rows["test 2, 2000 mm: standard deviation"].verdict.value == "refuted"


def test_gamma_of_the_print_is_right_where_the_first_joint_is_at_zero_and_only_there():
    Q = np.zeros((40, 6))
    Q[:, 1] = np.linspace(-0.5, 1.0, 40)
    Q[:, 2] = np.linspace(-1.5, -0.3, 40)
    for first, right in ((0.0, True), (0.7, False)):
        Q[:, 0] = first
        off_by = np.abs(level_link_4(Q, printed=True) - Q[:, None, 1:3]).max(axis=2).min(axis=1)
        assert (off_by < 1e-9).all() == right
        np.testing.assert_allclose(np.abs(level_link_4(Q, printed=False)[:, 1, :] - Q[:, 1:3]).max(), 0.0, atol=1e-9)


def test_the_count_of_routes_is_a_power():
    assert [listed_routes(3, 1, edges) for edges in (1, 2, 3)] == [6, 36, 216]
    assert listed_routes(3, 2, 1) == printed_routes(3, 2, 1) == 90
    assert printed_routes(3, 1, 2) == 12


def test_a_change_of_at_most_1_has_no_value_in_the_print():
    assert undefined(np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 2.0]])) == 1


@pytest.mark.parametrize("draw", ["surface", "projected", "uniform"])
def test_first_links_point_where_their_samples_lie(draw):
    angles = np.abs(first_directions(draw, 20_000, np.random.default_rng(0)))
    tangent = np.arcsin(30.0 / np.linalg.norm([20.0, 30.0]))
    if draw == "uniform":
        assert angles.max() > 3.0
        return
    assert angles.max() <= tangent + 1e-9
    near_the_tangents = (angles > 0.9 * tangent).mean()
    assert near_the_tangents > 0.2  # even directions would give 0.1


@pytest.mark.parametrize("kind", ["projected-a", "projected-b"])
def test_projected_samples_lead_to_the_goal_unless_rule_a_traps_them(kind):
    run = grow(Links([10.0] * 3), [12.0, 9.0], kind, tolerance=3.0, rng=np.random.default_rng(1), passes=200)
    assert run.solved_in or kind == "projected-a"
    np.testing.assert_allclose(np.linalg.norm(np.diff(run.chain, axis=0), axis=1), 10.0)


def test_a_figure_says_where_it_is_from_and_what_of_the_print_is_marked(tmp_path):
    drawn = []
    figure = Figure("x", "a line", "[1, figure 9]", lambda drawing, quick: drawn.append((drawing, quick)))
    figure.save(tmp_path / "x.png", True)
    ((drawing, quick),) = drawn
    assert quick
    assert drawing.get_suptitle() == f"a line\n[1, figure 9]; {PICTURE}"
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="does not exist"):
        figure.save(tmp_path / "nowhere" / "x.png", True)


def test_the_growth_of_a_tree_is_drawn(tmp_path):
    FIGURES["mb-rrt-example"][0].save(tmp_path / "growth.png", True)
    assert (tmp_path / "growth.png").stat().st_size > 5_000


def test_samples_beyond_the_limits_alone_bring_the_letter_to_a_goal_at_a_limit():
    letter, beyond = (approach(WRIST, rule, 0, 3_000) for rule in ("to the letter", "samples beyond the limits"))
    assert not letter.arrived
    assert letter.connects == 1  # not one step was blocked
    assert beyond.arrived
    assert np.degrees(letter.at[-1, 4]) < 85.0
    assert (np.diff(letter.nearest) <= 0.0).all()


def test_near_a_limit_few_steps_to_the_letter_lead_there():
    gaps = np.array([1.0, 90.0])
    np.testing.assert_allclose(outward_share("to the letter", gaps, 180.0), gaps / 180.0)
    np.testing.assert_allclose(outward_share("samples beyond the limits", gaps, 180.0), (gaps + 90.0) / 360.0)
    np.testing.assert_allclose(outward_share("directions of equal chance", gaps, 180.0), 0.5)


def test_the_planar_examples_are_drawn(tmp_path):
    figure = next(each for each in ikurt_figures.FIGURES["ikurt-examples"] if each.name == "ikurt_planar")
    figure.save(tmp_path / "planar.png", True)
    assert (tmp_path / "planar.png").stat().st_size > 5_000


def test_the_paper_counts_the_verdicts_of_the_round_that_is_stored():
    stored = (ROOT / "bench" / "reports" / "reproduce_full.md").read_text(encoding="utf-8")
    paper = (ROOT / "docs" / "science" / "paper.md").read_text(encoding="utf-8")
    told = [int(n) for n in re.findall(r"\d+", re.search(r"The full round has (.*)\.\n", paper)[1])]
    assert told[1:] == [int(n) for n in re.findall(r"\d+", re.search(r"In all: (.*)\.\n", stored)[1])]
    assert told[0] == sum(told[1:])


def test_the_paper_tells_of_plans_in_time_what_the_stored_round_has():
    stored = (ROOT / "bench" / "reports" / "reproduce_full.md").read_text(encoding="utf-8")
    paper = (ROOT / "docs" / "science" / "paper.md").read_text(encoding="utf-8").partition("### 5.4")[2]
    told = " ".join(paper.partition("### 5.5")[0].split())
    scenes = {"at 0.5 m/s": "{} of the time among 20 fast obstacles", "up to 0.2 m/s": "{} among slow ones",
              "six triangles": "{} among the triangles", "two pockets": "{} between the pockets"}  # fmt: skip
    for scene, words in scenes.items():
        ours, theirs = re.search(rf"{scene}: time of arrival .*\| ([\d.]+) s beside ([\d.]+) s \|", stored).groups()
        assert words.format(f"{float(ours) / float(theirs):.2f}") in told
    counts = re.findall(r"planned in time, proven \| not in the print \| (\d+) of (\d+), every move proven", stored)
    found, asked = np.array(counts, dtype=int).sum(axis=0)
    assert f"{'all of ' if found == asked else f'{found} of '}{asked} plans found" in told
    judged_plans = (ROOT / "bench" / "reports" / "in_time.md").read_text(encoding="utf-8")
    assert f"{re.search(r'times of ([0-9,]+) plans', judged_plans)[1]} further plans" in told


def test_a_table_that_says_who_set_its_bars_says_so_on_its_page():
    table = next(each for each in COLLECTION.tables if each.name == "ikurt-limits")
    row = judged("a", "0", "c", 0.0, exactly(0, 1))
    assert f"\nBars: {table.bars}.\n" in page([(table, [row])], True)
