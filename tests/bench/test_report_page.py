"""Pages of measurements have one form: acceptance rows with a verdict, then sections."""

from rrtik_bench.report.page import Report
from rrtik_bench.report.rows import Verdict


def page():
    report = Report("Speed", "python speed.py", intro="What was done.")
    report.bar("time", "<= 1 s", "0.5 s", True)
    report.table("Times", ("what", "seconds"), [("a", "1"), ("|b|", "2")], text="In seconds.")
    return report


def test_a_page_has_its_head_then_the_verdicts_then_the_sections(tmp_path, capsys):
    report = page()
    assert report.finish(tmp_path / "new" / "page.md") == 0
    text = (tmp_path / "new" / "page.md").read_text()
    assert capsys.readouterr().out == text + "\n"
    order = (
        "# Speed",
        "Written by `python speed.py`",
        "What was done.",
        "1 of 1 held",
        "## Times",
        "In seconds.",
        "| a |",
    )
    places = [text.index(each) for each in order]
    assert places == sorted(places)
    assert "| time | <= 1 s | 0.5 s | held |" in text
    assert r"| \|b\| | 2 |" in text


def test_a_missed_row_stands_out_and_is_exit_1(tmp_path):
    part, report = Report("", ""), page()
    part.bar("memory", "<= 1 MB", "2 MB", False)
    report.add(part)
    assert report.finish(tmp_path / "page.md") == 1
    assert "## Acceptance: 1 of 2 held" in report.markdown()
    assert "| memory | <= 1 MB | 2 MB | **missed** |" in report.markdown()


def test_only_a_miss_is_no_success():
    assert [verdict.passes for verdict in Verdict] == [True, True, True, True, False]
