"""Verdicts have power: work that is lost, and prints that are wrong, are seen in figures as they are stored."""

import gzip
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from rrtik_bench.crdt import tables as crdt
from rrtik_bench.genetic import tables as genetic
from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.mb_rrt.runs import PUBLISHED, Measured
from rrtik_bench.report.basis import STATEMENTS, WORDS, is_printed
from rrtik_bench.report.rows import INFINITE, STATISTICS, Bar, Verdict, exactly, judged, judged_runs, row_of
from rrtik_ompl.cli.app import run
from rrtik_tests.places import ROOT

RANK = {Verdict.BETTER: 0, Verdict.HELD: 0, Verdict.DIFFERS: 1, Verdict.REFUTED: 2, Verdict.MISSED: 3}


def worse(before, after):
    """Names of rows whose verdict is worse than before; none may be better."""
    assert [row.name for row in before] == [row.name for row in after]
    assert all(RANK[b.verdict] >= RANK[a.verdict] for a, b in zip(before, after, strict=True) if a.verdict)
    return [a.name for a, b in zip(before, after, strict=True) if a.verdict and RANK[b.verdict] > RANK[a.verdict]]


# --- power, as each row states it ------------------------------------------------------------------------------------


def test_the_change_that_a_row_says_it_sees_is_the_least_that_turns_its_verdict():
    rng = np.random.default_rng(0)
    for _ in range(500):
        ends = np.sort(rng.uniform(0.0, 10.0, 4))
        bar = Bar((0.0, 10.0), held=(ends[1], ends[2]), differs=(ends[0], ends[1]))
        value = float(rng.uniform(0.0, 10.0))
        below, above = bar.turns(value)
        inside = [each for each in np.linspace(0.0, 10.0, 2001) if below <= each <= above]
        assert {bar(each) for each in inside} == {bar(value)}
        for end, towards in ((below, -INFINITE), (above, INFINITE)):
            assert not np.isfinite(end) or bar(float(np.nextafter(end, towards))) is not bar(value)


@pytest.mark.parametrize(
    ("value", "bar", "said"),
    [
        (4.0, Bar((0.0, 100.0), held=(3.0, 5.0)), "-25 %, +25 %"),
        (0.0, Bar((0.0, 10.0), held=(0.0, 0.5)), "to 0.5"),
        (1.0, Bar((0.0, 1.0), held=(1.0, 1.0)), "any less"),
        (7.0, exactly(7, 50), "any less, any more"),
        (2e-15, Bar((0.0, 10.0), held=(0.0, 1e-9)), "to 1e-09"),
        (-0.2, Bar((-1.0, 1.0), held=(-0.3, 0.0)), "-50 %, +1e+02 %"),
        (float("nan"), exactly(7, 50), ""),
    ],
)
def test_the_least_change_is_told_in_the_measure_of_the_number(value, bar, said):
    assert judged("x", "1", "1", value, bar).detects == said


# --- what is printed, and what is ours -------------------------------------------------------------------------------


def test_every_figure_of_the_stored_round_is_judged_by_the_print_or_by_a_bar_of_ours():
    stored = (ROOT / "bench" / "reports" / "reproduce_full.md").read_text(encoding="utf-8")
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in stored.splitlines() if line.startswith("|")]
    prints = {row[1].strip() for row in cells if len(row) >= 5 and row[3].strip() not in ("verdict", "---", "-")}
    assert len(prints) > 150
    assert {is_printed(text) for text in prints} == {True, False}
    assert not STATEMENTS & WORDS


def test_words_of_which_nobody_said_whether_they_judge_make_no_row():
    with pytest.raises(ValueError, match="neither a number nor among"):
        judged("x", "quite good", "1", 1.0, exactly(1, 9))


# --- rows that are stored --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", STATISTICS)
def test_a_stored_row_is_judged_again_from_its_runs(by):
    runs = [1.0, 2.0, 4.0, 9.0]
    value = STATISTICS[by](runs)
    row = judged_runs("x", "1", "m", runs, Bar((0.0, INFINITE), held=(value, value)), "read so", by=by)
    assert row_of(row.record()) == row
    assert row.record()["bar"]["possible"] == [0.0, "inf"]
    changed = {**row.record(), "runs": [1.0, 2.0, 4.0, 10.0]}
    if by != "least" and by != "median":
        with pytest.raises(ValueError, match="its runs give"):
            row_of(changed)


def test_a_stored_verdict_that_does_not_follow_is_refused():
    record = judged("x", "1", "2", 2.0, exactly(1, 9)).record()
    assert record["verdict"] == "missed"
    with pytest.raises(ValueError, match="'held' is stored, 2 is 'missed'"):
        row_of({**record, "verdict": "held"})


def test_runs_that_are_none_are_missed_and_come_back_so():
    row = judged_runs("x", "1", "none", [], exactly(1, 9))
    again = row_of(row.record())
    assert row.verdict is again.verdict is Verdict.MISSED
    assert row.record()["value"] == "nan"


def test_the_stored_page_follows_from_the_stored_runs(tmp_path, capsys):
    page, stored = tmp_path / "page.md", ROOT / "bench" / "data" / "reproduce_part.json.gz"
    assert run(["reproduce", "--all", "--read", str(stored), "--markdown", str(page)]) == 1  # some are missed
    capsys.readouterr()
    again, before = (file.read_text().split("\n\n", 2) for file in (page, ROOT / "bench/reports/reproduce_part.md"))
    assert again[2] == before[2]  # what is before names the machine and the version


def test_what_is_expected_of_environment_e_is_what_its_stored_runs_gave():
    data = json.loads(gzip.decompress((ROOT / "bench" / "data" / "reproduce_part.json.gz").read_bytes()))
    rows = {row["name"]: row for row in data["tables"]["crdt-e"]}
    for name, columns in crdt.REBUILT.items():
        for column, before in zip(crdt.COLUMNS, columns, strict=False):
            for statistic, value in zip(crdt.STATISTICS_OF_E, before, strict=True):
                runs = rows[f"{name}: {statistic} {column}"]["runs"]
                assert len(runs) == crdt.RUNS_OF_E
                assert STATISTICS[statistic](runs) == pytest.approx(value, abs=1e-3)


# --- mutations, on figures as the full round has them ----------------------------------------------------------------


def skewed(mean, deviation, count=1000):
    """Counts of a tree's iterations: skewed samples with a mean and a deviation."""
    shape = np.random.default_rng(1).exponential(size=count)
    return mean + deviation * (shape - shape.mean()) / shape.std(ddof=1)


def rows_of_e(name, k, *, factor=1.0):
    """Mean and deviation of a column in environment E as the full round has them, times a factor."""
    mean, _, _, deviation = crdt.REBUILT[name][k]
    rows = crdt._column(name, k, crdt.COLUMNS[k], factor * skewed(mean, deviation))
    return [row for row in rows if f"{name}: mean" in row.name or f"{name}: deviation" in row.name]


@pytest.mark.parametrize("name", ["RRT", "C-RDT"])
@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("factor", [1.4, 0.7])
def test_a_tree_that_needs_two_fifths_more_is_seen_by_its_mean_and_its_deviation(name, k, factor):
    before, after = rows_of_e(name, k), rows_of_e(name, k, factor=factor)
    assert all(row.verdict in (Verdict.HELD, Verdict.DIFFERS, Verdict.MISSED) for row in before)
    changed = [row.name for a, row in zip(before, after, strict=True) if row.verdict is not a.verdict]
    assert f"{name}: mean {crdt.COLUMNS[k]}" in changed


def test_c_rdt_with_two_fifths_more_iterations_loses_the_claimed_ratio():
    columns = {name: np.array([skewed(row[0], row[3]) for row in table]) for name, table in crdt.REBUILT.items()}
    before = crdt._ratios(columns)
    columns["C-RDT"][0] *= 1.4
    assert worse(before, crdt._ratios(columns)) == ["mean iterations, C-RDT over RRT"]


@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("factor", [1.0 / 3.0, 0.5, 2.0])
def test_a_print_of_environment_e_that_is_wrong_by_a_factor_is_missed(monkeypatch, k, factor):
    before = rows_of_e("RRT", k)[0]
    monkeypatch.setitem(crdt.TABLES_OF_E, "RRT", tuple(
        tuple(factor * each if i == k and statistic == 0 else each for i, each in enumerate(row))
        for statistic, row in enumerate(crdt.TABLES_OF_E["RRT"])
    ))  # fmt: skip
    after = rows_of_e("RRT", k)[0]
    assert before.verdict is Verdict.DIFFERS
    assert after.verdict is Verdict.MISSED


def planar_rows(monkeypatch, factor):
    """Table of the planar arm, with last numbers of moves as the full round has them, times a factor."""

    def runs(name, count):
        mean = crdt.SQUARES_MOVES[name[-1]]
        last = np.full(count, np.floor(mean))
        last[: round((mean - np.floor(mean)) * count)] += 1.0
        return [SimpleNamespace(moves=[8.0, 6.0, factor * each], lengths=[3.0, 2.0, 1.0]) for each in last]

    monkeypatch.setattr(crdt, "_runs", runs)
    return crdt.planar(False)


def test_cuts_that_leave_three_tenths_more_moves_are_seen(monkeypatch):
    before, after = planar_rows(monkeypatch, 1.0), planar_rows(monkeypatch, 1.3)
    assert [row.verdict.value for row in before] == ["held"] * 4
    assert worse(before, after) == [row.name for row in before[:3]]
    assert [row.verdict for row in after[:3]] == [Verdict.MISSED] * 3


def test_a_lower_bound_that_is_one_too_high_is_seen(monkeypatch):
    before = planar_rows(monkeypatch, 1.0)
    right = crdt.lower_bound
    monkeypatch.setattr(crdt, "lower_bound", lambda start, goal: right(start, goal) + 1)
    assert worse(before, planar_rows(monkeypatch, 1.0)) == ["start and goal: c, the joints that differ"]


def surface_b(print_factor=1.0, passes=1.0, monkeypatch=None):
    """Superficie B with 3 joints as the full round has it; the printed mean, or the passes, times a factor."""
    share, mean, *rho = PUBLISHED[3]["surface-b"]
    if monkeypatch is not None:
        monkeypatch.setitem(PUBLISHED[3], "surface-b", (share, print_factor * mean, *rho))
    hits = tuple(round(passes * each) for each in [6] * 18 + [7] * 17)
    return mb_rrt.variant_rows(3, "surface-b", {0.3: Measured(100.0, hits, (0.27, 0.36), (0.16, 0.30))}, 35)


def test_a_printed_mean_of_passes_that_is_too_high_is_no_improvement(monkeypatch):
    before, after = surface_b(), surface_b(16.7844 / 6.7844, monkeypatch=monkeypatch)
    assert worse(before, after) == ["Superficie B: mean passes"]
    assert after[1].verdict is Verdict.DIFFERS


def test_twice_the_passes_are_missed():
    assert worse(surface_b(), surface_b(passes=2.0)) == ["Superficie B: mean passes"]


@pytest.mark.parametrize("printed", [2000, 6678, 4245, 8587])
def test_a_third_of_the_printed_generations_is_seen(printed):
    runs = {"historical": [SimpleNamespace(completed=100.0, generations=round(0.95 * printed))] * 5}
    before, after = (genetic._generations("x", each, 7, runs, 10_000) for each in (printed, printed // 3))
    assert worse(before, after) == ["x, historical: generations"]
