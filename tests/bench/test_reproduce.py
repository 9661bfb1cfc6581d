"""`rrtik reproduce`: every table is there, tells what was printed, and says honestly what to make of it."""

import json
from functools import partial

import numpy as np
import pytest

from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.mb_rrt.runs import PUBLISHED, Measured
from rrtik_bench.registry import COLLECTION
from rrtik_bench.report.rows import Row, Verdict, verdict, within
from rrtik_bench.tables import Collection, Table
from rrtik_ompl import catalog
from rrtik_ompl.cli.app import run
from rrtik_ompl.cli.reproduce import chosen
from rrtik_ompl.errors import UnknownNameError

HELD, DIFFERS, MISSED = Verdict
TABLES = {table.name: table for table in COLLECTION.tables}
FAST = ("titan4", "sensing-arithmetic", "sensing-noise", "sensing-accuracy", "crdt-routes", "mb-rrt-example",
        "mb-rrt-10", "ikurt-solutions", "drrt-con-arm")  # fmt: skip


def test_all_tables_of_the_quick_round_together_are_said_to_take_less_than_ten_minutes():
    assert sum(table.quick_seconds for table in TABLES.values()) < 600.0
    assert all(table.quick_seconds <= table.seconds for table in TABLES.values())


def test_the_beginning_of_names_chooses_all_tables_of_a_page():
    assert [table.name for table in chosen(TABLES, ["sensing", "mb-rrt-8"])] == [
        "mb-rrt-8",
        "sensing-arithmetic",
        "sensing-noise",
        "sensing-precision",
        "sensing-gripper",
        "sensing-accuracy",
    ]
    with pytest.raises(UnknownNameError, match="no table 'mbrrt'"):
        chosen(TABLES, ["mbrrt"])


@pytest.mark.parametrize("table", chosen(TABLES, FAST), ids=lambda table: table.name)
def test_no_figure_is_missed_and_what_differs_has_a_reading(table):
    rows = table.run(True)
    assert rows
    for row in rows:
        assert row.verdict in (HELD, DIFFERS), row
        assert row.published
        assert row.measured
        assert row.reading or row.verdict == HELD, row
    assert [row.name for row in rows] == list(dict.fromkeys(row.name for row in rows))


def test_the_same_table_is_measured_the_same_twice():
    assert TABLES["mb-rrt-10"].run(True) == TABLES["mb-rrt-10"].run(True)


def test_a_verdict_follows_from_chance_and_expectation():
    assert (verdict(True), verdict(False, True), verdict(False)) == (HELD, DIFFERS, MISSED)
    assert within(2.0, 5.0, 10.0)
    assert not within(2.0, 4.9, 10.0)
    assert not within(2.0, float("nan"), 10.0)


@pytest.mark.parametrize(
    ("converged", "mean", "wanted"),
    [
        (100.0, 245.0, (HELD, HELD)),  # as printed
        (100.0, 97.0, (HELD, DIFFERS)),  # what the ring about the goal predicts
        (100.0, 3000.0, (HELD, MISSED)),
        (50.0, 97.0, (MISSED, DIFFERS)),
    ],
)
def test_a_variant_is_judged_by_its_print_and_by_what_its_rules_predict(converged, mean, wanted):
    rho = PUBLISHED[3]["uniform-b-star"][2:]
    found = Measured(converged, mean, (rho[0], rho[0]), (rho[1], rho[1]))
    rows = mb_rrt._variant(3, "uniform-b-star", found, 35)
    assert tuple(row.verdict for row in rows[:2]) == wanted
    assert rows[2].verdict == HELD


def rrtik(capsys, *arguments):
    code = run(["reproduce", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_list_names_every_table_and_what_is_not_there(capsys):
    code, out, _ = rrtik(capsys, "--list")
    assert code == 0
    assert all(name in out for name in TABLES)
    assert all(line in out for line in COLLECTION.not_here)


def test_published_stands_beside_measured_and_the_time_is_said_first(capsys, tmp_path):
    file = tmp_path / "tables.md"
    code, out, err = rrtik(capsys, "crdt-routes", "--markdown", str(file))
    assert code == 0
    assert err == "rrtik: 1 table, about 1 s on two cores\n"
    assert "1 held" in out
    assert "| Routes(3, 1), Routes(3, 2) | 6, 90 | 6, 90 | held |" in file.read_text()
    code, out, _ = rrtik(capsys, "crdt-routes", "--quick", "--json")
    (row,) = json.loads(out)["crdt-routes"]
    assert (row["published"], row["measured"]) == ("6, 90", "6, 90")


def test_a_missed_figure_is_exit_1(capsys, monkeypatch):
    rows = [Row("a", "1", "2", MISSED), Row("b", "1", "1", HELD)]
    table = Table("x-1", "made up", "nowhere", partial(lambda rows, quick: rows, rows), 1, 1)
    monkeypatch.setattr(catalog, "find_tables", lambda: (Collection((table,)),))
    code, out, _ = rrtik(capsys, "x")
    assert code == 1
    assert "1 missed, 1 held" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give their names, or --all"),
        (["--all", "sensing"], "give their names, or --all"),
        (["sensng"], "no table 'sensng'"),
        (["sensing", "--markdown", "x.pdf"], "unknown ending '.pdf'"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, arguments, said):
    code, out, err = rrtik(capsys, *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_singular_titan_postures_are_on_the_axis_they_are_named_for():
    from rrtik_bench.titan4 import D6, _singular
    from rrtik_ompl.catalog import load_robot

    Q = _singular("shoulder and wrist", 50, np.random.default_rng(0))
    tips = load_robot("titan4").fk_batch(Q)
    np.testing.assert_allclose((tips[:, :3, 3] - D6 * tips[:, :3, 2])[:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.cos(Q[:, 4]), 0.0, atol=1e-15)


def test_tables_are_found_through_the_entry_points():
    assert COLLECTION in catalog.find_tables()
    assert len(TABLES) == len(COLLECTION.tables)


def test_without_a_package_that_offers_tables_the_command_says_so(capsys, monkeypatch):
    monkeypatch.setattr(catalog, "find_tables", lambda: ())
    assert rrtik(capsys, "--all") == (2, "", "rrtik: no installed package offers published tables\n")
