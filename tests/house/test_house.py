"""The bounds of the house: sizes of folders and files, complexity, parameters, repeated logic, citations, types."""

import ast

import pytest

import house


@pytest.fixture(scope="module")
def findings():
    return house.findings()


@pytest.mark.parametrize("what", house.BOUNDS)
def test_the_house_keeps_its_bounds(what, findings):
    measured = [item for item in findings if item.what == what]
    broken = [f"{item.value} at {item.where}" for item in measured if item.broken]
    assert measured
    assert not broken, f"{what}: at most {house.BOUNDS[what]}, but\n" + "\n".join(broken)


def test_every_kind_of_finding_has_a_bound(findings):
    assert {item.what for item in findings} == set(house.BOUNDS)


def test_the_report_has_a_line_for_each_bound(findings):
    lines = house.report(findings).splitlines()
    assert [line.split("  ")[0] for line in lines if not line.startswith(" ")] == list(house.BOUNDS)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("return 1", 1),
        ("return a if b else c", 2),
        ("return a and b or c", 3),
        ("if a:\n  pass\nelif b:\n  pass\nelse:\n  pass", 3),
        ("return [x for x in y if x if z]", 3),
        ("try:\n  pass\nexcept A:\n  pass\nexcept B:\n  pass", 3),
        ("match a:\n  case 1:\n    pass\n  case _:\n    pass", 3),
        ("for a in b:\n  while c:\n    assert d", 4),
    ],
)
def test_complexity_counts_the_places_where_control_branches(text, value):
    assert house.complexity(ast.parse("def f():\n" + "\n".join(f"  {line}" for line in text.splitlines()))) == value


@pytest.mark.parametrize(
    ("annotation", "bare"),
    [("Any", True), ("Any | None", True), ("Mapping[str, Any]", False), ("object", False), ("None", False)],
)
def test_a_value_is_untyped_if_it_is_any_itself(annotation, bare):
    assert house.is_any(ast.parse(annotation, mode="eval").body) == bare
