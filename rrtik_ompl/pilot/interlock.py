"""Which commands are refused, by what is known of the picture, of the arm, and of the route.

The rule: nothing moves, is planned or accepted on a picture that is stale or on joints that are not read any more, and
no route is followed that was not accepted. Where the vehicle moves, no route is proposed or followed past what was not
seen lately; driving by hand remains. Commands that stop, choose or leave are never refused here.

Arguments of commands come from outside: only what a command expects is accepted.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.messages import quoted

if TYPE_CHECKING:
    from rrtik_ompl.pilot.state import State

MANOEUVRE = "manoeuvre"
CHOOSING = "choosing"
PROPOSED = "proposed"
FOLLOWING = "following"
MODES: Final = (MANOEUVRE, CHOOSING, PROPOSED, FOLLOWING)
STALE_SECONDS = 0.5  # a picture older than that does not show the present
UNSEEN_SECONDS = 2.0  # what has been out of view for longer is no basis of a route, where the vehicle moves
LATE_SECONDS = 0.3  # a pilot who sees what the arm does later than that does not drive it

ACKNOWLEDGE: Final = "STOP acknowledges that"

BY_HAND: Final = (MANOEUVRE, CHOOSING, PROPOSED)
ON_A_ROUTE: Final = "a route is being followed: 'next' makes its next move, 'stop' leaves it"

MAX_NUMBER = 1e6  # that a command may hold
MAX_WORD_LENGTH = 100  # of a word in a command


@dataclass(frozen=True, slots=True)
class Verb:
    """A command of the pilot: what executes it, and what it needs. A verb that stops, chooses or leaves needs nothing.

    Attributes:
        act: Called with the `Means`, the `State`, and the command's arguments by their names, numbers as ``float`` and
            words as ``str``; returns the next `State`.
        present: It needs the arm and a picture of now.
        held: The arm moves only as long as the command is renewed; the pilot has to see it.
        guided: It leads past things without the pilot's judgement, and so needs all of them seen.
        gripping: It is given even while the gripper is closed on something fixed; asked only where ``present``.
        modes: In which it is given.
        otherwise: Why it is refused in the others.
    """

    act: Callable[..., State]
    present: bool = False
    held: bool = False
    guided: bool = False
    gripping: bool = False
    modes: tuple[str, ...] = MODES
    otherwise: str = ""


@dataclass(frozen=True, slots=True)
class Sight:
    """What a page had shown to the pilot who commands: by the stamps that the page sends back with the command.

    Attributes:
        state: Age of the last state [s]; inf if the page does not say.
        picture: Age of the last picture of the camera [s]; inf if the page does not say.
    """

    state: float
    picture: float


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What is known at a moment.

    Attributes:
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        picture_age: Of the last picture [s]; inf if there was none.
        past: Pictures are photographs or a film, and the arm is a simulated one: no picture is of now, none is stale.
        arm_off: Why joints and pictures contradict each other; "" if they do not.
        unusable: Why the last photograph or picture of a film could not be used; "" if it could.
        fault: What the arm has done that it was not told; "" if nothing, or the pilot has acknowledged it.
        sight: What the pilot sees; None without a page.
        unseen: What the scene stands on and the camera has not shown lately, in one line; "" if there is no such thing.
    """

    arm_lost: str
    picture_age: float
    past: bool = False
    arm_off: str = ""
    unusable: str = ""
    fault: str = ""
    sight: Sight | None = None
    unseen: str = ""

    @property
    def trouble(self) -> str:
        """Why the present is not known, or the arm cannot be trusted; "" if all is well."""
        if self.arm_lost or self.fault or self.arm_off:
            return self.arm_lost or self.fault or self.arm_off
        if self.past or self.picture_age <= STALE_SECONDS:
            return self.unusable if self.past else ""
        return "there is no picture yet" if self.picture_age == float("inf") else "the picture is stale"

    @property
    def blind(self) -> str:
        """Why the pilot does not see the arm well enough to drive it; "" if he does."""
        sight = self.sight
        if sight is None or (sight.state <= LATE_SECONDS and (self.past or sight.picture <= STALE_SECONDS)):
            return ""
        if sight.state == float("inf"):
            return "the page does not say what it has shown: reload it"
        if sight.state > LATE_SECONDS:
            return f"line too slow for driving: {sight.state:.2g} s"
        if sight.picture == float("inf"):
            return "the page shows no picture yet: press again when it does"
        return f"the picture on the page is stale: {sight.picture:.2g} s"


def refusal(verb: Verb, mode: str, known: Knowledge) -> str:
    """Why a command is refused, in one line; "" if it is not.

    Args:
        verb: The command.
        mode: One of `MODES`.
        known: Of the moment.

    Example:
        >>> refusal(Verb(print, present=True), FOLLOWING, Knowledge("", picture_age=60.0))
        'refused: the picture is stale'
    """
    if mode not in verb.modes:
        return verb.otherwise

    if verb.present and known.trouble:
        return f"refused: {known.trouble}" + (f"; {ACKNOWLEDGE}" if known.trouble == known.fault else "")
    if verb.guided and known.unseen:
        return f"refused: {known.unseen}; bring it into view, or drive by hand"
    return f"refused: {known.blind}" if verb.held and known.blind else ""


# --- arguments of commands -------------------------------------------------------------------------------------------


def number(value: object, name: str) -> float:
    """A finite number of moderate size.

    Raises:
        InputError: If it is none.
    """
    plain = value.item() if isinstance(value, np.number) else value
    if isinstance(plain, bool) or not isinstance(plain, int | float) or not -MAX_NUMBER <= plain <= MAX_NUMBER:
        raise InputError(f"{name} must be a finite number, got {quoted(value)!r}")
    return float(plain)


def fitting(act: Callable[..., object], name: str, arguments: Mapping[str, object]) -> dict[str, float | str]:
    """The arguments of a command, if they are those that are taken by what executes it.

    Args:
        act: Its first two parameters are not of the command; the others are words, ``str``, or numbers.
        name: Of the command.
        arguments: By their names.

    Raises:
        InputError: If one is missing, unknown, or of another kind.
    """
    wanted = list(inspect.signature(act).parameters.values())[2:]
    if set(arguments) != {each.name for each in wanted}:
        given = ", ".join(arguments)[:MAX_WORD_LENGTH] or "none"
        takes = ", ".join(each.name for each in wanted) or "no arguments"
        raise InputError(f"{name} takes {takes}, got {given}")

    words = {each.name for each in wanted if each.annotation in (str, "str")}
    return {each: _value(f"{name}: {each}", each in words, value) for each, value in arguments.items()}


def _value(place: str, word: bool, value: object) -> float | str:
    if not word:
        return number(value, place)
    if not isinstance(value, str) or len(value) > MAX_WORD_LENGTH:
        raise InputError(f"{place} must be a word, got {quoted(value)!r}")
    return value
