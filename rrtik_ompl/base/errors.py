"""All errors of the library: one root class; each message is one line that names what is wrong and the remedy."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from inspect import signature
from itertools import islice
from types import UnionType
from typing import Any, get_args

MOST_MEMBERS = 1_000_000  # largest number of members of a list given by a user


def _restored(kind: type[RrtikError], args: tuple[Any, ...], attributes: dict[str, Any]) -> RrtikError:
    """Create an error that was pickled, with its attributes, without calling its constructor."""
    error = kind.__new__(kind, *args)
    error.args = args
    vars(error).update(attributes)
    return error


def printable(text: str) -> str:
    """Return a text with all control characters and other unprintable letters replaced by escape sequences."""
    return text if text.isprintable() else "".join(c if c.isprintable() else _spelt(c) for c in text)


def _spelt(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


class RrtikError(Exception):
    """Root of all errors that the library raises on purpose.

    The text is always a single line for a person: the file, the field, what was found and the remedy.

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
        return _restored, (type(self), self.args, vars(self))  # constructors take other arguments than args


class InputError(RrtikError):
    """A file, an argument or a value given by the user cannot be used.

    Example:
        >>> rrtik.Box([0.1, -0.2, 0.3])
        Traceback (most recent call last):
        rrtik_ompl.base.errors.InputError: box size must be three numbers greater than 0, got [0.1, -0.2, 0.3]
    """


class MissingFileError(InputError):
    """A file that another file names does not exist."""


class EmptyMeshError(InputError):
    """A mesh file is whole and holds no triangle."""


class UnknownNameError(InputError):
    """A name does not exist; the error carries the names that do.

    Args:
        kind: What the name is of, such as "robot".
        name: The name that was asked for.
        alternatives: The names that exist.
        where: File or element in which it stands.
        similar: Those of them that may have been meant; all if None.

    Attributes:
        name: The name that was asked for.
        alternatives: The names that exist, sorted.

    Example:
        >>> rrtik.load_robot("pnada")
        Traceback (most recent call last):
        rrtik_ompl.base.errors.UnknownNameError: no robot 'pnada'; did you mean 'panda'? have ...
    """

    def __init__(
        self,
        kind: str,
        name: object,
        alternatives: Iterable[str],
        *,
        where: str = "",
        similar: Iterable[str] | None = None,
    ) -> None:
        self.name = str(name)
        self.alternatives = tuple(sorted(map(str, listed(alternatives, "alternatives of a name"))))
        require(where, str, "place of a name")

        meant = {each.lower(): each for each in (self.alternatives if similar is None else similar)}
        near = get_close_matches(self.name.lower(), meant, n=1)
        hint = f"; did you mean '{meant[near[0]]}'?" if near else ";"
        have = ", ".join(self.alternatives) or "none"
        prefix = f"{where}: " if where else ""
        super().__init__(f"{prefix}no {kind} '{self.name}'{hint} have {have}")


class ProblemError(RrtikError):
    """A planning problem is ill-posed: its start or goal is in collision, outside the limits or cannot be reached.

    Attributes:
        contacts: Pairs of names in collision, empty if the reason is another one.
        part: The part that is wrong: "start" or "goal".

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
    """Return an error whose message begins with the name of the file, unless it does already."""
    return error if str(error).startswith(str(path)) else InputError(f"{path}: {error}")


class PlannerError(RrtikError):
    """A planner failed with an error, as opposed to not finding a path, which is a result (``Plan.reason``).

    Example:
        >>> issubclass(rrtik.PlannerError, rrtik.RrtikError)
        True
    """


class NotFoundError(RrtikError):
    """What was searched for was not found: raised by ``require()`` of a result, with the reason of the result.

    Example:
        >>> robot = rrtik.load_robot("ur5")
        >>> rrtik.solve_ik(robot, rrtik.PositionGoal([9.0, 0.0, 0.0])).require()
        Traceback (most recent call last):
        rrtik_ompl.base.errors.NotFoundError: no configuration: unreachable: ...
    """


def require(value: object, kind: type | UnionType, what: str, remedy: str = "") -> None:
    """Refuse an argument that is not of the required type, or of one of several types.

    Raises:
        InputError: The message names the argument, the expected and the given type, and the remedy.
    """
    if not isinstance(value, kind):
        wanted = " or ".join(each.__name__ for each in get_args(kind) or (kind,))
        hint = f"; {remedy}" if remedy else ""
        found = f"the class {value.__name__}" if isinstance(value, type) else type(value).__name__
        raise InputError(f"{what} must be of type {wanted}, got {found}{hint}")


def called(value: object, what: str, *arguments: str) -> None:
    """Refuse an argument that cannot be called with the given number of arguments; these are named for the message.

    Raises:
        InputError: The message names the argument and its type.
    """
    wanted = f"{what}: expected a function of {' and '.join(arguments) or 'no arguments'}"
    if not callable(value):
        raise InputError(f"{wanted}, got {type(value).__name__}")

    try:
        signature(value).bind(*arguments)
    except TypeError as error:
        raise InputError(f"{wanted}: {error}") from None
    except ValueError:  # some built-in functions have no signature
        return


def name_of(value: object, what: str) -> str:
    """Validate the name of a link, joint or solid: text that can be shown and written to a file.

    Raises:
        InputError: If it is not text, or contains unprintable letters.
    """
    require(value, str, f"name of {what}")
    name = str(value)
    if not name.isprintable():
        raise InputError(f"name of {what}: '{name}' has letters that cannot be shown; rename it")
    return name


def at_most(count: float, limit: float, what: str, remedy: str = "") -> None:
    """Refuse a number of things above a limit.

    Raises:
        InputError: The message names the number and the limit.
    """
    if count > limit:
        hint = f"; {remedy}" if remedy else ""
        shown = count if isinstance(count, int) else f"{count:.0f}" if count < 1e15 else f"{count:g}"
        raise InputError(f"{what}: {shown} are more than the {limit:.0f} that are allowed{hint}")


def listed(values: object, what: str, most: int = MOST_MEMBERS) -> tuple[Any, ...]:
    """Return the members of a list or another iterable as a tuple; text is not accepted.

    Raises:
        InputError: If it is not iterable, or has more than ``most`` members; no more are taken from an endless one.
    """
    if isinstance(values, str) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) == 0:
        raise InputError(f"{what} must be a list, got {type(values).__name__}")
    members = values if type(values) is tuple else tuple(islice(values, most + 1))
    if len(members) > most:
        raise InputError(f"{what}: more than the {most} members that are allowed")
    return members


def few(names: Iterable[str], most: int = 4) -> str:
    """Join the first of some names with the number of the others: "a, b and 3 more"."""
    known = tuple(names)
    rest = len(known) - most
    return ", ".join(known[:most]) + (f" and {rest} more" if rest > 0 else "")


class MeshWarning(UserWarning):
    """A mesh is missing or is probably not the solid that its author meant; the program continues."""


class DescriptionWarning(UserWarning):
    """A robot's description contains something wrong or unsupported; the program continues."""


class ArmWarning(UserWarning):
    """A description does not say which of its joints and frames are the arm; the line says what was chosen."""


class CloudWarning(UserWarning):
    """A point cloud or a grid of heights is probably not what its author meant; the program continues."""


class PoseWarning(UserWarning):
    """An orientation is probably not what its author meant: another order of its numbers, or degrees."""


class SceneWarning(UserWarning):
    """Something in a scene file is represented differently in the world that is made of it."""


class DependencyWarning(UserWarning):
    """A package is installed in a version below the lowest one that is admitted; what needs it may fail."""


class PathWarning(UserWarning):
    """A path or motion is not taken, or not changed, in the way that its author may have meant; the line says how."""


class PictureWarning(UserWarning):
    """A picture shows less than there is; checks and plans use all of it."""


class ProofWarning(UserWarning):
    """A configuration cannot be proven free, so that no motion from or to it counts as free."""
