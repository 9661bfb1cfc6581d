"""All errors of the toolkit: one root, each message is one line that names what is wrong and how to mend it."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from inspect import signature
from itertools import islice
from types import UnionType
from typing import Any, NoReturn, get_args

MOST_MEMBERS = 1_000_000  # of a list that is given


def _restored(kind: type[RrtikError], args: tuple[Any, ...], attributes: dict[str, Any]) -> RrtikError:
    """Return the error that came from another process."""
    error = kind.__new__(kind, *args)
    error.args = args
    vars(error).update(attributes)
    return error


def printable(text: str) -> str:
    """Return the text with every letter that a terminal would obey instead of showing it, or cannot show, spelt out."""
    return text if text.isprintable() else "".join(c if c.isprintable() else _spelt(c) for c in text)


def _spelt(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


class RrtikError(Exception):
    """Root of every error raised on purpose by the toolkit.

    Its text is always a single line fit for a person: the file, the field, what was found, the remedy.

    Example:
        >>> try:
        ...     rrtik.load_problem("no_such_problem")
        ... except rrtik.RrtikError as error:
        ...     print(type(error).__name__)
        UnknownNameError
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(" ".join(str(message).split())))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.args, vars(self))  # whatever the constructor wants


class InputError(RrtikError):
    """A file, an argument or a value given by the user cannot be used.

    Example:
        >>> rrtik.Box([0.1, -0.2, 0.3])
        Traceback (most recent call last):
        rrtik_ompl.base.errors.InputError: box size must be three numbers greater than 0, got [0.1, -0.2, 0.3]
    """


class MissingFileError(InputError):
    """A file that another file names does not exist."""


class UnknownNameError(InputError):
    """A name was asked for that does not exist; carries the names that do.

    Attributes:
        name: The name that was asked for.
        alternatives: The names that exist, sorted.

    Example:
        >>> rrtik.load_robot("pnada")
        Traceback (most recent call last):
        rrtik_ompl.base.errors.UnknownNameError: no robot 'pnada'; ... did you mean 'panda'?
    """

    def __init__(self, kind: str, name: object, alternatives: Iterable[str], *, where: str = "") -> None:
        self.name = str(name)
        self.alternatives = tuple(sorted(map(str, listed(alternatives, "alternatives of a name"))))
        require(where, str, "place of a name")

        near = get_close_matches(self.name, self.alternatives, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        have = ", ".join(self.alternatives) or "none"
        prefix = f"{where}: " if where else ""
        super().__init__(f"{prefix}no {kind} '{self.name}'; have {have}{hint}")


class ProblemError(RrtikError):
    """A planning problem is ill-posed: start or goal in collision, outside limits, or unreachable by construction.

    Attributes:
        contacts: Pairs of names in collision, empty if the reason is another one.
        part: What is wrong with it: "start" or "goal".

    Example:
        >>> ball = rrtik.Obstacle("ball", rrtik.Sphere(0.5), [1.0, 0.0, 0.0])
        >>> world = rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([ball]))
        >>> rrtik.Problem(world, np.zeros(3), [1.5, 0.0, 0.0])
        Traceback (most recent call last):
        rrtik_ompl.base.errors.ProblemError: start is in collision...
    """

    def __init__(self, message: str, contacts: Iterable[tuple[str, str]] = (), *, part: str = "start") -> None:
        self.contacts = listed(contacts, "contacts of a problem")
        self.part = part
        super().__init__(message)


def in_file(path: object, error: InputError) -> InputError:
    """Return the same error, naming the file before all else, as errors of its lines do by themselves."""
    return error if str(error).startswith(str(path)) else InputError(f"{path}: {error}")


class PlannerError(RrtikError):
    """A planner broke (as opposed to not finding a path, which is data: see ``Plan.reason``).

    Example:
        >>> issubclass(rrtik.PlannerError, rrtik.RrtikError)
        True
    """


def require(value: object, kind: type | UnionType, what: str, remedy: str = "") -> None:
    """Refuse an argument that is not of the type, or of one of the types, that is needed.

    Raises:
        InputError: It names the argument, what was expected, what was found, and the remedy.
    """
    if not isinstance(value, kind):
        wanted = " or ".join(each.__name__ for each in get_args(kind) or (kind,))
        hint = f"; {remedy}" if remedy else ""
        raise InputError(f"{what} must be of type {wanted}, got {type(value).__name__}{hint}")


def called(value: object, what: str, *arguments: str) -> None:
    """Refuse an argument that cannot be called with so many arguments, which are named.

    Raises:
        InputError: It names the argument, and what was found.
    """
    wanted = f"{what}: expected a function of {' and '.join(arguments) or 'no arguments'}"
    if not callable(value):
        raise InputError(f"{wanted}, got {type(value).__name__}")

    try:
        signature(value).bind(*arguments)
    except TypeError as error:
        raise InputError(f"{wanted}: {error}") from None
    except ValueError:  # some that are built in do not say
        return


def name_of(value: object, what: str) -> str:
    """Return a name of a link, joint or solid: text that can be shown and written to a file.

    Raises:
        InputError: If it is no text, or has letters that no terminal shows.
    """
    require(value, str, f"name of {what}")
    name = str(value)
    if not name.isprintable():
        raise InputError(f"name of {what}: '{name}' has letters that cannot be shown; rename it")
    return name


def at_most(count: float, limit: float, what: str, remedy: str = "") -> None:
    """Refuse a number of things above what is sensible.

    Raises:
        InputError: It says the number and the limit.
    """
    if count > limit:
        hint = f"; {remedy}" if remedy else ""
        shown = count if isinstance(count, int) else f"{count:.0f}" if count < 1e15 else f"{count:g}"
        raise InputError(f"{what}: {shown} are more than the {limit:.0f} that are allowed{hint}")


def listed(values: object, what: str, most: int = MOST_MEMBERS) -> tuple[Any, ...]:
    """Return the members of a list, or of anything else that has members, but of a text.

    Raises:
        InputError: If it has none, or more than ``most``; of what never ends no more are taken.
    """
    if isinstance(values, str) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) == 0:
        raise InputError(f"{what} must be a list, got {type(values).__name__}")
    members = tuple(islice(values, most + 1))
    if len(members) > most:
        raise InputError(f"{what}: more than the {most} members that are allowed")
    return members


def few(names: Iterable[str], most: int = 4) -> str:
    """Return the first of some names, and how many more there are: "a, b and 3 more"."""
    known = tuple(names)
    rest = len(known) - most
    return ", ".join(known[:most]) + (f" and {rest} more" if rest > 0 else "")


class MeshWarning(UserWarning):
    """A mesh is missing or cannot be the solid that its author probably meant, but work can go on."""


class DescriptionWarning(UserWarning):
    """A robot's description says something that is wrong or is not read, but work can go on."""


class TipWarning(UserWarning):
    """Nobody has said where the tip of an arm is, and more than one link may be it."""


class CloudWarning(UserWarning):
    """A cloud of points, or a grid of heights, is probably not what its author meant, but work can go on."""


class SceneWarning(UserWarning):
    """Something that the file of a scene says is not as it says in the world that is made of it."""


class PathWarning(UserWarning):
    """What was asked for does not apply to a path, which stays as it is."""


class Renamed:
    """An attribute that has another name now; whoever asks for it is told so.

    Example:
        >>> class Arm:
        ...     joints = Renamed("joint_names")
        >>> Arm().joints
        Traceback (most recent call last):
        AttributeError: 'Arm' has no attribute 'joints': it is now 'joint_names'
    """

    def __init__(self, new: str) -> None:
        self._new = new
        self._old = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = name

    def __get__(self, instance: object, owner: type) -> NoReturn:
        raise AttributeError(f"'{owner.__name__}' has no attribute '{self._old}': it is now '{self._new}'")
