"""What files may say: kinds of values, and sections, which are groups of keys; what is wrong is one line for a person.

A kind reads a value or refuses it, and has a JSON schema. A section names its keys and of what kind each of them is::

    class PoseTarget(Section):
        pose = key(PoseEntry)
        tolerance = key(POSITIVE, "[m]", default=1e-3)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from math import isinf, isnan
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, overload

from rrtik_ompl.base.arrays import LARGEST
from rrtik_ompl.base.colors import PATTERN, color_of
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.strict_yaml import Location, YamlDocument, describe
from rrtik_ompl.files.text import is_number

if TYPE_CHECKING:
    from typing_extensions import Self

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Schema = dict[str, Any]

SMALLEST = 1e-6  # [m] smaller geometry is a mistake and breaks collision checking


class Refused(Exception):
    """What is wrong with a value of a file: messages, each with its place below that value."""

    def __init__(self, message: str, *place: str | int) -> None:
        super().__init__(message)
        self.faults: list[tuple[Location, str]] = [(place, message)]


class Kind(Protocol[T_co]):
    """What may stand in a place of a file."""

    def read(self, value: object) -> T_co:
        """Return what a value of the file means.

        Raises:
            Refused: If it is not of this kind.
        """
        ...

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema; those of sections are added to ``parts``."""
        ...


def read_each(rows: Iterable[tuple[str | int, Kind[T], object]]) -> list[T]:
    """Read values in their places; what is wrong with any of them is refused together."""
    found = []
    faults: list[tuple[Location, str]] = []
    for place, kind, value in rows:
        try:
            found.append(kind.read(value))
        except Refused as refused:
            faults += [((place, *below), message) for below, message in refused.faults]

    if faults:
        together = Refused("")
        together.faults = faults
        raise together
    return found


def _not_a(what: str, value: object) -> Refused:
    """Refuse a value that is something else than it must be."""
    quoted = "number" in what and isinstance(value, str) and is_number(value)
    return Refused(f"must be {what}, found {describe(value)}" + ("; write it without quotes" if quoted else ""))


# --- kinds -----------------------------------------------------------------------------------------------------------


class _Plain:
    """A kind whose JSON schema stands for itself."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        del parts
        return self._schema


class Number(_Plain):
    """A finite number within bounds; ``above`` is one that it must exceed."""

    def __init__(self, least: float = -LARGEST, most: float = LARGEST, *, above: float | None = None) -> None:
        self._least = least
        self._most = most
        self._above = above
        low = {"minimum": least} if above is None else {"exclusiveMinimum": above}
        super().__init__({"type": "number", **low, "maximum": most})

    def read(self, value: object) -> float:
        """Return the number."""
        if type(value) is not float and type(value) is not int:  # true is an instance of int
            raise _not_a("a number", value)
        if type(value) is float and (isnan(value) or isinf(value)):
            raise _not_a("a finite number", value)
        self.check(value)
        return float(value)

    def check(self, value: float) -> None:
        """Refuse a number outside the bounds."""
        if value > self._most:
            raise Refused(f"must be {self._most:g} or less, found {describe(value)}")
        if self._above is not None and value <= self._above:
            raise Refused(f"must be greater than {self._above:g}, found {describe(value)}")
        if value < self._least:
            raise Refused(f"must be {self._least:g} or more, found {describe(value)}")


class Whole(_Plain):
    """A whole number within bounds."""

    def __init__(self, least: int = -(2**63), most: int = 2**63 - 1) -> None:
        self._bounds = Number(least, most)
        super().__init__({"type": "integer", "minimum": least, "maximum": most})

    def read(self, value: object) -> int:
        """Return the number."""
        if type(value) is not int:
            raise _not_a("a whole number", value)
        self._bounds.check(value)
        return value


class Flag(_Plain):
    """True or false; with ``numbers``, 1 and 0 mean these, too."""

    def __init__(self, *, numbers: bool = False) -> None:
        self._numbers = numbers
        super().__init__({"type": "boolean"})

    def read(self, value: object) -> bool:
        """Return whether it is true."""
        if isinstance(value, bool) or (self._numbers and value in (0, 1)):
            return bool(value)
        raise _not_a("true or false", value)


class Text(_Plain):
    """Text of at least so many letters."""

    def __init__(self, least: int = 0) -> None:
        self._least = least
        super().__init__({"type": "string", "minLength": least})

    def read(self, value: object) -> str:
        """Return the text."""
        if not isinstance(value, str):
            raise Refused(f"must be text, found {describe(value)}; put it in quotes if it is a name")
        if len(value) < self._least:
            raise Refused("must not be empty")
        return value


class Choice(_Plain):
    """One of several words or whole numbers."""

    def __init__(self, *words: str | int) -> None:
        self._words = words
        super().__init__({"enum": list(words)})

    def read(self, value: object) -> Any:  # noqa: ANN401 - a type checker is told by the key
        """Return the word."""
        if value in self._words and not isinstance(value, bool):  # true equals 1
            return value
        *others, last = map(repr, self._words)
        raise _not_a(f"{', '.join(others)} or {last}" if others else last, value)


class Color(_Plain):
    """A colour: '#rrggbb', or red, green and blue from 0 to 1."""

    def __init__(self) -> None:
        super().__init__({"anyOf": [{"type": "string", "pattern": PATTERN}, SHARES3.schema({})]})

    def read(self, value: object) -> str:
        """Return the colour as '#rrggbb'."""
        remedy = "'#rrggbb' in quotes, or [red, green, blue] from 0 to 1"
        try:
            color = color_of(value if isinstance(value, str) else SHARES3.read(value), "color")
        except (InputError, Refused):
            raise _not_a(f"a colour, {remedy}", value) from None
        assert color is not None, "there is a value"
        return color


class Anything(_Plain):
    """Whatever stands there."""

    def __init__(self) -> None:
        super().__init__({})

    def read(self, value: object) -> Any:  # noqa: ANN401 - as the name says
        """Return the value."""
        return value


class Listed(Generic[T]):
    """A list of values of one kind, at least and at most so many."""

    def __init__(self, kind: Kind[T], least: int = 0, most: int | None = None) -> None:
        self._kind = kind
        self._least = least
        self._most = most

    def read(self, value: object) -> list[T]:
        """Return what each of the values means."""
        if not isinstance(value, list):
            raise _not_a("a list in square brackets", value)
        if self._most is not None and len(value) > self._most:
            raise Refused(f"takes at most {_entries(self._most)}, found {describe(value)}")
        found = read_each((place, self._kind, each) for place, each in enumerate(value))
        _check_number(value, self._least)
        return found

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        most = {} if self._most is None else {"maxItems": self._most}
        return {"type": "array", "items": self._kind.schema(parts), "minItems": self._least, **most}


class Mapped(Generic[T]):
    """A group of keys that are names, with values of one kind, at least so many."""

    def __init__(self, kind: Kind[T], least: int = 0) -> None:
        self._kind = kind
        self._least = least

    def read(self, value: object) -> dict[str, T]:
        """Return what each of the values means, by name."""
        if not isinstance(value, dict):
            raise _not_a("a group of keys", value)
        read_each((name, NAME, name) for name in value)
        found = read_each((name, self._kind, each) for name, each in value.items())
        _check_number(value, self._least)
        return dict(zip(value, found, strict=True))

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        names = {"propertyNames": NAME.schema(parts), "minProperties": self._least}
        return {"type": "object", "additionalProperties": self._kind.schema(parts), **names}


class Either(Generic[T]):
    """One kind for values of a type of Python, and another one for all else."""

    def __init__(self, of_type: type, kind: Kind[T], otherwise: Kind[T]) -> None:
        self._type = of_type
        self._kind = kind
        self._otherwise = otherwise

    def read(self, value: object) -> T:
        """Return what the value means."""
        return (self._kind if isinstance(value, self._type) else self._otherwise).read(value)

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        return {"anyOf": [self._kind.schema(parts), self._otherwise.schema(parts)]}


class ToldApart(Generic[T]):
    """One of several sections, told by a key that it has; or plain text."""

    def __init__(self, what: str, kinds: Mapping[str, Kind[T]], text: tuple[str, Kind[T]] | None = None) -> None:
        """Take the sections by their keys, of which the first that is there counts.

        Args:
            what: What all of them are, in messages.
            kinds: The sections.
            text: What plain text is, in messages, and its kind.
        """
        self._what = what
        self._kinds = kinds
        self._text = text

    def read(self, value: object) -> T:
        """Return the section."""
        if self._text is not None and isinstance(value, str):
            return self._text[1].read(value)
        if isinstance(value, dict):
            for name, kind in self._kinds.items():
                if name in value:
                    return kind.read(value)

        words = [*self._kinds, *([] if self._text is None else [f"or {self._text[0]}"])]
        near = [close for name in value for close in _near(name, words)] if isinstance(value, dict) else []
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise Refused(f"{self._what} needs one of the keys {', '.join(words)}; found {describe(value)}{hint}")

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        text = [] if self._text is None else [self._text[1]]
        return {"anyOf": [kind.schema(parts) for kind in (*text, *self._kinds.values())]}


class Later(Generic[T]):
    """A kind that is defined below the section that has a key of it."""

    def __init__(self, kind: Callable[[], Kind[T]]) -> None:
        self._kind = kind

    def read(self, value: object) -> T:
        """Return what the value means."""
        return self._kind().read(value)

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        return self._kind().schema(parts)


def _check_number(value: list[object] | dict[str, object], least: int) -> None:
    """Refuse a list or group of fewer entries than there must be."""
    if len(value) < least:
        raise Refused(f"needs at least {_entries(least)}, found {describe(value)}")


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count} entries"


def _near(name: object, names: Iterable[str]) -> list[str]:
    """Return the name that may be meant, if one is similar."""
    return get_close_matches(str(name), list(names), n=1)


NUMBER = Number()
POSITIVE = Number(above=0.0)
NOT_NEGATIVE = Number(0.0)
LENGTH = Number(SMALLEST)
WHOLE = Whole()
TEXT = Text()
NAME = Text(1)
FLAG = Flag()
ANYTHING = Anything()
VERSION = Choice(1)
NUMBERS = Listed(NUMBER, 1)
LENGTHS3 = Listed(LENGTH, 3, 3)
VECTOR2 = Listed(NUMBER, 2, 2)
VECTOR3 = Listed(NUMBER, 3, 3)
VECTOR4 = Listed(NUMBER, 4, 4)
SHARES3 = Listed(Number(0.0, 1.0), 3, 3)
COLOR = Color()


# --- sections --------------------------------------------------------------------------------------------------------


REQUIRED: Any = object()


class Key:
    """A key of a section: what may stand there, what it means, and its value where it is absent."""

    def __init__(self, kind: Kind[Any], text: str, default: object) -> None:
        self.kind = kind
        self.text = text
        self.default = default

    def schema(self, parts: dict[str, Schema]) -> Schema:
        """Return the JSON schema."""
        schema = dict(self.kind.schema(parts))
        if self.text:
            schema["description"] = self.text
        if self.default is not REQUIRED and self.default is not None and not isinstance(self.default, Section):
            schema["default"] = self.default
        return schema


@overload
def key(kind: Kind[T], text: str = "") -> T: ...
@overload
def key(kind: Kind[T], text: str = "", *, default: T) -> T: ...
def key(kind: Kind[Any], text: str = "", *, default: object = REQUIRED) -> Any:
    """Return a key of a section; to a type checker it is the value in a section that has been read.

    Args:
        kind: What may stand there.
        text: What it means, for the JSON schema.
        default: The value where the key is absent; without one it must be there.
    """
    return Key(kind, text, default)


class _Missing(Anything):
    """Refuses what is not there."""

    def read(self, value: object) -> Any:  # noqa: ANN401 - it never returns
        del value
        raise Refused("missing; add this key")


_MISSING = _Missing()


class Section:
    """A group of keys in a file; a key that it does not know is an error that lists those it knows.

    A section is a kind itself. ``class A(Section, keys={...})`` has keys that are not written out.

    Attributes:
        keys: Its keys and those of its bases, by name.
        open: Whether further keys may stand there, which are not read.
        further_schema: What its JSON schema says beside its keys.
    """

    keys: ClassVar[dict[str, Key]] = {}
    open: ClassVar[bool] = False
    further_schema: ClassVar[Schema] = {}

    def __init_subclass__(cls, keys: Mapping[str, Any] | None = None) -> None:
        super().__init_subclass__()
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}
        cls.keys = {**cls.keys, **own, **(keys or {})}

    def __init__(self, **values: object) -> None:
        """Take values of keys as they are; the others have their defaults."""
        for name, each in self.keys.items():
            setattr(self, name, values.get(name, each.default))

    @classmethod
    def read(cls, value: object) -> Self:
        """Return the section.

        Raises:
            Refused: If it is none, with all that is wrong with it.
        """
        if not isinstance(value, dict):
            raise _not_a("a group of keys", value)
        given = cls.prepared(value)
        rows: list[tuple[str, Kind[Any], object]] = []
        for name, each in cls.keys.items():
            if name in given:
                rows.append((name, each.kind, given[name]))
            elif each.default is REQUIRED:
                rows.append((name, _MISSING, None))

        values = read_each(rows)
        section = cls(**{name: value for (name, _, _), value in zip(rows, values, strict=True)})
        section.check_together()
        return section

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the keys and values that are read, after a look at all that stand there.

        Raises:
            Refused: If a key is unknown or empty.
        """
        for name, value in data.items():
            if name not in cls.keys and not cls.open:
                near = _near(name, cls.keys)
                hint = f"did you mean '{near[0]}'? " if near else ""
                raise Refused(f"unknown key '{name}'; {hint}allowed keys: {', '.join(cls.keys)}", name)
            if value is None:
                is_color = name in cls.keys and isinstance(cls.keys[name].kind, Color)
                quotes = " (a colour in quotes, as # begins a comment)" if is_color else ""
                raise Refused(f"nothing stands after the colon; give a value{quotes} or delete the key", name)
        return data

    def check_together(self) -> None:
        """Refuse values that do not fit each other."""

    def only_one(self, keys: Iterable[str], what: str) -> str:
        """Return the only key of ``keys`` that has a value; ``what`` needs it.

        Raises:
            Refused: If none or several of them have a value.
        """
        wanted = tuple(keys)
        given = [name for name in wanted if getattr(self, name) is not None]
        if len(given) == 1:
            return given[0]
        found = " and ".join(given) if given else "none of them"
        raise Refused(f"{what} needs exactly one of {', '.join(wanted)}; found {found}")

    @classmethod
    def schema(cls, parts: dict[str, Schema]) -> Schema:
        """Return a reference to the JSON schema, which is in ``parts``."""
        name = cls.__name__
        if name not in parts:
            parts[name] = {}  # it may be a part of itself
            parts[name] = {
                "type": "object",
                "description": cls.__doc__,
                "properties": {word: each.schema(parts) for word, each in cls.keys.items()},
                "required": [word for word, each in cls.keys.items() if each.default is REQUIRED],
                "additionalProperties": cls.open,
                **cls.further_schema,
            }
        return {"$ref": f"#/$defs/{name}"}


def parse(document: YamlDocument, kind: Kind[T], data: object = None) -> T:
    """Read what a document says.

    Args:
        document: The file.
        kind: Its section.
        data: Data to read instead of the document's top level, with the same locations; None for the document.

    Raises:
        InputError: One line with file, line, key, what was found and the remedy; further errors are counted.
    """
    try:
        return kind.read(document.data if data is None else data)
    except Refused as refused:
        (place, message), *others = refused.faults
        more = f" (and {len(others)} more)" if others else ""
        raise document.error(place, message + more) from None


def schema_of(section: type[Section]) -> Schema:
    """Return the JSON schema of files that are such a section, which is no part of itself."""
    parts: dict[str, Schema] = {}
    section.schema(parts)
    own = parts.pop(section.__name__)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **own, "$defs": parts}
