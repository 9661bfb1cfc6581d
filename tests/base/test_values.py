"""Classes of `base.values` do what those of Python's ``dataclasses`` do."""

import copy
import dataclasses
import inspect
import itertools
import pickle
from dataclasses import field
from functools import cached_property

import pytest

from rrtik_ompl.base import values

OPTIONS = [
    dict(zip(("frozen", "slots", "eq", "repr", "kw_only"), flags, strict=True))
    for flags in itertools.product((False, True), repeat=5)
]


def answer(call):
    """What a call returns, or how it fails."""
    try:
        return call()
    except Exception as error:
        return type(error).__name__, str(error).partition("<locals>.")[2] or str(error)


def kind_of(dataclass, options):
    @dataclass(**options)
    class Ball:
        """A ball."""

        radius: float
        name: str = "ball"
        _: dataclasses.KW_ONLY
        parts: list = field(default_factory=list, compare=False)
        seen: int = field(default=3, repr=False)
        address: int = field(init=False)
        marks: tuple = field(init=False, default=(1,))

        def __post_init__(self):
            object.__setattr__(self, "address", 7)

    return Ball


def told(kind):
    """What can be asked of such a class and of its values."""
    one, same, other = kind(radius=1.0), kind(radius=1.0, parts=[2]), kind(radius=2.0, name="b", seen=4)
    shown = repr(one).partition("<locals>.")[2].partition(" object at")[0]
    yield shown, one == same, one == other, one == 1.0, one != same
    yield answer(lambda: hash(one) == hash(same)), answer(lambda: hash(one) == hash(other))
    yield [(each.name, each.init, each.kw_only, each.type) for each in dataclasses.fields(kind)]
    yield inspect.signature(kind).replace(return_annotation=None).parameters.keys(), kind.__match_args__
    yield [(p.kind, p.annotation) for p in inspect.signature(kind).parameters.values()]
    yield dataclasses.asdict(one), dataclasses.replace(other, radius=3.0).name, one.parts is same.parts
    yield answer(lambda: setattr(one, "radius", 5.0)), one.radius
    yield (
        answer(lambda: setattr(one, "unknown", 5.0)) is None,
        hasattr(one, "unknown"),
    )  # Python's message is a TypeError
    yield answer(lambda: delattr(one, "name")), hasattr(one, "__dict__")
    yield answer(lambda: kind()), answer(lambda: kind(1.0, "a", 2)), answer(lambda: kind(radius=1, size=2))
    yield copy.copy(other).name, copy.deepcopy(other).seen, kind.__dataclass_params__.frozen


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: "-".join(k for k in options if options[k]) or "none")
def test_a_class_does_what_that_of_python_does(options):
    quick, known = kind_of(values.dataclass, options), kind_of(dataclasses.dataclass, options)
    assert list(told(quick)) == list(told(known))


@values.dataclass(frozen=True, slots=True)
class Point:
    """A value that can be pickled."""

    x: float
    y: float = 0.0


@values.dataclass(frozen=True, slots=True, eq=False)
class Point3(Point):
    """A value that inherits fields."""

    z: float = 0.0


@values.dataclass(frozen=True)
class Line:
    """A value that remembers what it has computed, and compares in its own way."""

    start: Point
    end: Point

    @cached_property
    def length(self):
        return abs(self.end.x - self.start.x)

    def __eq__(self, other):
        return self.length == other.length


def test_values_are_pickled_inherited_matched_and_remember():
    assert pickle.loads(pickle.dumps(Point(1.0, 2.0))) == Point(1.0, 2.0)
    assert Point3(1.0, z=2.0).z == 2.0
    assert [each.name for each in dataclasses.fields(Point3)] == ["x", "y", "z"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        Point3(1.0).x = 2.0
    match Point(1.0, 2.0):
        case Point(x, y):
            assert (x, y) == (1.0, 2.0)

    line = Line(Point(1.0), Point(3.0))
    assert line.length == 2.0
    assert line == Line(Point(2.0), Point(4.0))
    assert len({line, Line(Point(1.0), Point(3.0))}) == 1
    line.__dict__["inner"] = line
    assert repr(line) == "Line(start=Point(x=1.0, y=0.0), end=Point(x=3.0, y=0.0))"
