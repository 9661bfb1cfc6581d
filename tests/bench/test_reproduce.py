"""`rrtik reproduce`: every table is there, tells what was printed, and says honestly what to make of it."""

import json
import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rrtik_bench import registry
from rrtik_bench.crdt import tables as crdt
from rrtik_bench.genetic import tables as genetic
from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.mb_rrt.runs import PUBLISHED, Measured
from rrtik_bench.registry import COLLECTION
from rrtik_bench.report.rows import Bar, Row, Verdict, all_of, judged, within
from rrtik_bench.tables import Collection, Table
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli.app import run
from rrtik_ompl.cli.reproduce import chosen
from rrtik_ompl.description import catalog

HELD, BETTER, DIFFERS, REFUTED, MISSED = Verdict
TABLES = {table.name: table for table in COLLECTION.tables}
FAST = ("titan4", "sensing-arithmetic", "sensing-noise", "sensing-sequences", "errata-kinematics", "errata-grim",
        "errata-statistics",
        "crdt-routes", "mb-rrt-example", "mb-rrt-10", "mb-rrt-sliding", "mb-rrt-obstacles",
        "ikurt-solutions",
        "drrt-con-arm", "drrt-con-unannounced")  # fmt: skip


def test_all_tables_of_the_quick_round_together_are_said_to_take_less_than_ten_minutes():
    assert sum(table.quick_seconds for table in TABLES.values()) < 600.0
    assert all(table.quick_seconds <= table.seconds for table in TABLES.values())


def test_the_beginning_of_names_chooses_all_tables_of_a_page():
    assert [table.name for table in chosen(TABLES, ["sensing", "mb-rrt-8"])] == [
        "mb-rrt-8",
        "sensing-arithmetic",
        "sensing-shape",
        "sensing-noise",
        "sensing-precision",
        "sensing-gripper",
        "sensing-accuracy",
        "sensing-sequences",
        "sensing-detections",
    ]
    genetic_tables = [name for name in TABLES if name.startswith("ga-reb-")]
    assert [table.name for table in chosen(TABLES, ["genetic"], COLLECTION.also)] == genetic_tables
    with pytest.raises(UnknownNameError, match=r"no table 'mb-rtr'.* did you mean 'mb-rrt'"):
        chosen(TABLES, ["mb-rtr"])


@pytest.fixture(scope="module")
def measured():
    return {table.name: table.run(True) for table in chosen(TABLES, FAST)}


@pytest.mark.parametrize("table", chosen(TABLES, FAST), ids=lambda table: table.name)
def test_no_figure_is_missed_and_what_differs_has_a_reading(table, measured):
    rows = measured[table.name]
    assert rows
    for row in rows:
        assert row.verdict is not MISSED, row
        assert row.published
        assert row.measured
        assert row.reading or row.verdict == HELD, row
    assert [row.name for row in rows] == list(dict.fromkeys(row.name for row in rows))


def test_every_figure_that_is_measured_wrongly_is_missed_or_refutes_the_print(measured):
    for row in [row for rows in measured.values() for row in rows if row.verdict is not None]:
        assert row.verdict is row.bar(row.value), row
        assert row.bar(float("nan")) is MISSED, row
        wrong = {row.bar(end) for end in row.bar.possible} & {MISSED, REFUTED}
        assert wrong, row
        assert {row.bar(value) for value in row.bar.wrong()} <= {MISSED, REFUTED}, row


def test_no_table_makes_a_verdict_by_another_way_than_a_bar():
    folder = Path(registry.__file__).parent
    for file in folder.rglob("*.py"):
        if file.parent.name != "report":
            assert "verdict(" not in file.read_text(), file
            assert not re.search(r"(?<! is )Verdict\.", file.read_text()), file


def test_a_bar_that_nothing_can_miss_is_no_bar():
    with pytest.raises(ValueError, match="nothing can be missed"):
        Bar((0.0, 100.0), held=(0.0, 50.0), differs=(0.0, 100.0))


def test_the_first_interval_that_holds_a_number_gives_the_verdict():
    bar = Bar((0.0, 100.0), held=(40.0, 60.0), better=(60.0, 100.0), refuted=(0.0, 10.0), differs=(10.0, 40.0))
    assert [bar(value) for value in (50.0, 60.0, 61.0, 5.0, 20.0)] == [HELD, HELD, BETTER, REFUTED, DIFFERS]
    assert bar(float("nan")) is MISSED
    assert (all_of()(1.0), all_of()(0.99), all_of(refutes=True)(0.99)) == (HELD, MISSED, REFUTED)
    assert within(2.0, 10.0) == (5.0, 20.0)


def columns_of_e(*, iterations=1.0, checks=1.0, runs=1000):
    """Runs in environment E with the printed means and deviations; those of C-RDT times factors."""
    shape = np.random.default_rng(0).exponential(size=runs)
    shape = (shape - shape.mean()) / shape.std(ddof=1)
    columns = {name: np.array([table[0][k] + table[3][k] * shape for k in range(4)])
               for name, table in crdt.TABLES_OF_E.items()}  # fmt: skip
    columns["C-RDT"][0] *= iterations
    columns["C-RDT"][2] *= checks
    return columns


def test_bars_of_ratios_lie_on_the_side_of_1_that_the_source_claims():
    assert [row.verdict for row in crdt._ratios(columns_of_e())] == [HELD, HELD]
    assert [row.verdict for row in crdt._ratios(columns_of_e(iterations=1.2, checks=1.29))] == [MISSED, MISSED]
    assert "18 % more" in crdt._ratios(columns_of_e(checks=1.29))[1].reading
    assert all(row.bar.held[1] <= 1.0 for row in crdt._ratios(columns_of_e()))


def test_a_run_that_does_not_come_to_the_end_has_no_number_of_generations():
    half = SimpleNamespace(completed=50.0, generations=10_000)
    whole = SimpleNamespace(completed=100.0, generations=2_000)
    rows = genetic._generations("x", 2000, 7, {"a": [half, half], "b": [half, whole], "c": [whole, whole]}, 10_000)
    assert [row.verdict for row in rows] == [MISSED, MISSED, MISSED, HELD, HELD, HELD]
    assert rows[2].measured == "75.0 %"
    assert "1 of 2 runs complete" in rows[2].reading


def test_the_same_table_is_measured_the_same_twice(measured):
    assert TABLES["mb-rrt-10"].run(True) == measured["mb-rrt-10"]


@pytest.mark.parametrize(
    ("converged", "mean", "wanted"),
    [
        (100.0, 245, (HELD, HELD)),  # as printed
        (100.0, 97, (HELD, DIFFERS)),  # what the ring about the goal predicts
        (100.0, 3000, (HELD, MISSED)),
        (50.0, 97, (MISSED, DIFFERS)),
    ],
)
def test_a_variant_is_judged_by_its_print_and_by_what_its_rules_predict(converged, mean, wanted):
    rho = PUBLISHED[3]["uniform-b-star"][2:]
    found = Measured(converged, (mean,) * 35, (rho[0], rho[0]), (rho[1], rho[1]))
    rows = mb_rrt.variant_rows(3, "uniform-b-star", {0.3: found}, 35)
    assert tuple(row.verdict for row in rows[:2]) == wanted
    assert rows[2].verdict == HELD


@pytest.mark.parametrize("count", PUBLISHED)
@pytest.mark.parametrize("goals", [7, 35, 100])
def test_every_variant_can_be_missed_however_few_goals_it_has(count, goals):
    for name in PUBLISHED[count]:
        for converged in (0.0, 100.0 / goals, 100.0):
            found = Measured(converged, (50,) if converged else (), (0.2, 0.2), (0.2, 0.2))
            rows = mb_rrt.variant_rows(count, name, {mb_rrt.TOLERANCE[count]: found}, goals)
            assert all(row.bar.wrong() for row in rows if row.bar is not None)


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
    assert re.fullmatch(r"rrtik: 1 table.* 1 s .*\n", err)
    assert "2 held" in out
    assert "| Routes(3, 2) | 90 | 90 | held |" in file.read_text()
    assert "By what the sources print: 2 held." in file.read_text()
    assert not list(tmp_path.glob("*.jsonl"))
    assert "| any less, any more |" in file.read_text()
    code, out, _ = rrtik(capsys, "crdt-routes", "--quick", "--json")
    row = json.loads(out)["crdt-routes"][1]
    assert (row["published"], row["measured"], row["verdict"]) == ("90", "90", "held")


def made_up(*names, run):
    return Collection(tuple(Table(name, "made up", "nowhere", partial(run, name), 1, 1) for name in names))


def test_a_missed_figure_is_exit_1(capsys, monkeypatch):
    rows = [Row("a", "1", "2", MISSED), Row("b", "1", "1", HELD), Row("c", "1 s", "2 s", None)]
    monkeypatch.setattr(catalog, "find_tables", lambda: (made_up("x-1", run=lambda name, quick: rows),))
    code, out, _ = rrtik(capsys, "x")
    assert code == 1
    assert "1 held, 1 missed, 1 without a verdict" in out


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), InputError("page.md: cannot be written: no space left")])
def test_an_interrupted_round_goes_on_where_it_was(capsys, monkeypatch, tmp_path, stop):
    asked, stops, page = [], [stop], tmp_path / "page.md"

    def run_table(name, quick):
        asked.append(name)
        if name == "x-2" and stops:
            raise stops.pop()
        return [judged(name, "1", "1", 1.0, Bar((0.0, 2.0), held=(1.0, 1.0)), "as printed"), Row("s", "1", "2", None)]

    monkeypatch.setattr(catalog, "find_tables", lambda: (made_up("x-1", "x-2", "x-3", run=run_table),))
    code, _, err = rrtik(capsys, "x", "--markdown", str(page))
    assert code in (2, 130)
    assert "Traceback" not in err
    assert not page.exists()
    code, out, _ = rrtik(capsys, "x", "--markdown", str(page))
    assert code == 0
    assert asked == ["x-1", "x-2", "x-2", "x-3"]
    assert "kept from before" in out
    assert "3 held, 3 without a verdict" in page.read_text()
    assert list(tmp_path.iterdir()) == [page]
    rrtik(capsys, "x-1", "--quick", "--markdown", str(page))
    assert asked[-1] == "x-1"


@pytest.mark.parametrize("name", ["round.json", "round.json.gz"])
def test_a_stored_round_is_judged_again_and_has_the_same_page(capsys, tmp_path, name):
    stored, page, again = tmp_path / name, tmp_path / "page.md", tmp_path / "again.md"
    assert rrtik(capsys, "mb-rrt-10", "--quick", "--store", str(stored), "--markdown", str(page))[0] == 0
    code, out, err = rrtik(capsys, "mb-rrt-10", "--read", str(stored), "--markdown", str(again))
    assert (code, err) == (0, "")
    assert "precision, 3 joints ([3, table 10]), stored" in out
    assert again.read_text() == page.read_text()
    rows = json.loads(rrtik(capsys, "--all", "--read", str(stored), "--json")[1])["mb-rrt-10"]
    passes = next(row for row in rows if row["name"] == "0.01 cm: mean passes")
    assert passes["value"] == pytest.approx(np.mean(passes["runs"]), rel=1e-12)
    assert len(passes["runs"]) == 35
    low, high = passes["bar"]["held"]
    assert (passes["verdict"] == "held") == (low <= passes["value"] <= high)


def stored_text(capsys, file):
    rrtik(capsys, "crdt-routes", "--quick", "--store", str(file))
    return file.read_text()


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda text: text.replace('"verdict": "held"', '"verdict": "better"'), "'better' is stored, 6 is 'held'"),
        (lambda text: text.replace('"value": 90.0', '"value": 91.0'), "'held' is stored, 91 is 'missed'"),
        (lambda text: text.replace('"crdt-routes"', '"crdt-rotes"'), "table 'crdt-rotes': no installed package"),
        (lambda text: text.replace('"measured"', '"mesured"'), "table 'crdt-routes': 'measured'; measure it again"),
        (lambda text: text[:-9], "not a file of measured tables; `rrtik reproduce --store FILE` writes one"),
        (lambda text: "[1, 2]", "not a file of measured tables"),
    ],
)
def test_a_stored_round_of_which_a_verdict_does_not_follow_is_refused(capsys, tmp_path, damage, said):
    file = tmp_path / "round.json"
    file.write_text(damage(stored_text(capsys, file)))
    code, out, err = rrtik(capsys, "--all", "--read", str(file))
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert str(file) in err


def test_a_table_that_a_stored_round_does_not_have_is_named(capsys, tmp_path):
    file = tmp_path / "round.json"
    stored_text(capsys, file)
    code, out, err = rrtik(capsys, "crdt-routes", "titan4-size", "--read", str(file))
    assert (code, out) == (2, "")
    assert "has no rows of titan4-size; measure them" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give their names, or --all"),
        (["--all", "sensing"], "give their names, or --all"),
        (["sensng"], "did you mean 'sensing'?"),
        (["genetics"], "did you mean 'genetic'?"),
        (["crdt-routes", "--plot", "here"], "none of these tables has a figure"),
        (["sensing", "--markdown", "x.pdf"], "unknown ending '.pdf'"),
        (["sensing", "--store", "x.npz"], "unknown ending '.npz'"),
        (["sensing", "--read", "nothing.json"], "nothing.json: no such file"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, arguments, said):
    code, out, err = rrtik(capsys, *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_singular_titan_postures_are_on_the_axis_they_are_named_for():
    from rrtik_bench.titan4 import D6, _singular
    from rrtik_ompl.description.catalog import load_robot

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
