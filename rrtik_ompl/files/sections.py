"""The base of the sections of YAML files, and the conversion of pydantic's errors to one line for a person."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from rrtik_ompl.base.arrays import LARGEST
from rrtik_ompl.files.strict_yaml import Location, YamlDocument, describe
from rrtik_ompl.files.text import is_number

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


SMALLEST = 1e-6  # [m] smaller geometry is a mistake and breaks collision checking

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST)]
Length = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=SMALLEST, le=LARGEST)]
Name = Annotated[str, Field(min_length=1)]
Sizes3 = Annotated[list[Length], Field(min_length=3, max_length=3)]
Vector2 = Annotated[list[Number], Field(min_length=2, max_length=2)]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
Vector4 = Annotated[list[Number], Field(min_length=4, max_length=4)]
Numbers = Annotated[list[Number], Field(min_length=1)]


def _one(value: object) -> object:
    if value is True:  # True equals 1 in Python, but is not valid in a file
        raise PydanticCustomError("version", "must be 1, found true")
    return value


Version = Annotated[Literal[1], BeforeValidator(_one)]

_NO_KIND = "no_kind"
_ONE_OF = "needs one of the keys "
_TAG = "<"  # tags of unions begin with it, so that they differ from the keys in an error's location


class Section(BaseModel):
    """A group of keys in a file; a key that it does not know is an error that lists those it knows."""

    # The validator of a section is built when a file first contains one.
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, data: object) -> object:
        # Report unknown and empty keys before pydantic does, with a hint at a similar key.
        if not isinstance(data, dict):
            return data
        for key, value in data.items():
            if key not in cls.model_fields and cls.model_config.get("extra") == "forbid":
                near = get_close_matches(str(key), cls.model_fields, n=1)
                raise PydanticCustomError(
                    "unknown_key",
                    "unknown key '{key}'; {hint}allowed keys: {allowed}",
                    {
                        "key": str(key),
                        "hint": f"did you mean '{near[0]}'? " if near else "",
                        "allowed": ", ".join(cls.model_fields),
                    },
                )
            if value is None:
                message = "nothing stands after the colon; give a value or delete the key"
                raise PydanticCustomError("empty_key", message, {"key": str(key)})
        return data


Model = TypeVar("Model", bound=BaseModel)


def told_apart_by(*keys: str, what: str, text: str | None = None) -> Discriminator:
    """Select the member of a union by which of ``keys`` is present; members are tagged ``tag(key)``.

    Args:
        keys: The keys that distinguish the members.
        what: Name of the union in the message if none of them is present.
        text: Tag of the member that is plain text, if there is one.
    """

    def choose(data: object) -> str | None:
        if isinstance(data, BaseModel):
            return next((tag(key) for key in keys if key in type(data).model_fields), None)
        if text is not None and isinstance(data, str):
            return tag(text)
        return next((tag(key) for key in keys if key in data), None) if isinstance(data, dict) else None

    message = f"{_ONE_OF}{', '.join(keys)}" + (f", or {text}" if text else "")
    return Discriminator(choose, custom_error_type=_NO_KIND, custom_error_message=f"{what} {message}")


def tag(key: str) -> str:
    """Return the tag of the union member that is recognised by ``key``."""
    return f"{_TAG}{key}>"


def exactly_one(section: BaseModel, keys: Iterable[str], what: str) -> str:
    """Return the only key of ``keys`` that has a value in a validated section.

    Raises:
        PydanticCustomError: If none or several of them have a value.
    """
    wanted = tuple(keys)
    given = [key for key in wanted if getattr(section, key) is not None]
    if len(given) == 1:
        return given[0]
    found = " and ".join(given) if given else "none of them"
    raise PydanticCustomError("kind", f"{what} needs exactly one of {', '.join(wanted)}; found {found}")


def parse(document: YamlDocument, model: type[Model], data: object = None) -> Model:
    """Validate a document by a pydantic model.

    Args:
        document: The file.
        model: Its pydantic model.
        data: Data to validate instead of the document's top level, with the same locations; None for the document.

    Raises:
        InputError: One line with file, line, key, what was found and the remedy; further errors are counted.
    """
    try:
        return model.model_validate(document.data if data is None else data)
    except ValidationError as error:
        first, *others = error.errors(include_url=False)
        more = f" (and {len(others)} more)" if others else ""
        raise document.error(_location(first), _message(first) + more) from None


def without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Remove the null alternatives from a JSON schema that pydantic writes for optional keys.

    An absent key is absent in our files, never null, as ``anyOf: [.., null]`` would allow.
    """
    cleaned: dict[str, Any] = {k: _without_null(v) for k, v in schema.items() if not (k == "default" and v is None)}
    choices = [choice for choice in cleaned.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        del cleaned["anyOf"]
        return {**choices[0], **cleaned}
    return cleaned | ({"anyOf": choices} if choices else {})


def _without_null(part: object) -> object:
    if isinstance(part, list):
        return [_without_null(item) for item in part]
    return without_null(part) if isinstance(part, dict) else part


def _location(error: ErrorDetails) -> Location:
    parts = tuple(part for part in error["loc"] if not (isinstance(part, str) and part.startswith(_TAG)))
    key = error.get("ctx", {}).get("key")
    return parts if key is None else (*parts, key)


def _message(error: ErrorDetails) -> str:
    write = _MESSAGES.get(error["type"])
    found = describe(error["input"])
    if write is not None:
        return write(error.get("ctx", {}), found)
    return str(error["msg"]) + (_unknown_kind(error) if error["type"] == _NO_KIND else "")


def _unknown_kind(error: ErrorDetails) -> str:
    """Describe what was found in place of a key that tells the kind, and suggest the key that may be meant."""
    data = error["input"]
    kinds = error["msg"].partition(_ONE_OF)[2].split(", ")
    near: list[str] = []
    if isinstance(data, dict):
        near = [close for key in data for close in get_close_matches(str(key), kinds, n=1)]
    return f"; found {describe(data)}" + (f"; did you mean '{near[0]}'?" if near else "")


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count} entries"


def _must_be(what: str) -> Callable[[dict[str, Any], str], str]:
    def write(_context: dict[str, Any], found: str) -> str:
        quoted = "number" in what and is_number(found.removeprefix("text '").removesuffix("'"))
        return f"must be {what}, found {found}" + ("; write it without quotes" if quoted else "")

    return write


_MESSAGES: dict[str, Callable[[dict[str, Any], str], str]] = {
    "missing": lambda _context, _found: "missing; add this key",
    "float_type": _must_be("a number"),
    "int_type": _must_be("a whole number"),
    "bool_type": _must_be("true or false"),
    "string_type": lambda _context, found: f"must be text, found {found}; put it in quotes if it is a name",
    "list_type": _must_be("a list in square brackets"),
    "model_type": _must_be("a group of keys"),
    "model_attributes_type": _must_be("a group of keys"),
    "dict_type": _must_be("a group of keys"),
    "finite_number": _must_be("a finite number"),
    "greater_than": lambda context, found: f"must be greater than {context['gt']:g}, found {found}",
    "less_than_equal": lambda context, found: f"must be {context['le']:g} or less, found {found}",
    "greater_than_equal": lambda context, found: f"must be {context['ge']:g} or more, found {found}",
    "too_short": lambda context, found: f"needs at least {_entries(context['min_length'])}, found {found}",
    "too_long": lambda context, found: f"takes at most {_entries(context['max_length'])}, found {found}",
    "string_too_short": lambda _context, _found: "must not be empty",
    "literal_error": lambda context, found: f"must be {context['expected']}, found {found}",
}
