"""Decide which commands are refused, given what is known of the picture, the arm and the route.

The rule: nothing moves after STOP until it is reset; nothing moves, is planned or is accepted on a stale picture or on
joint values that are no longer read, and no route is followed that was not accepted. Where the vehicle moves, no route
is proposed or followed past objects that were not seen recently; driving by hand remains possible. Commands that stop,
choose or leave are never refused here.
Arguments of commands come from outside and are checked: only what a command expects is accepted.
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
NO_PICTURE: Final = "there is no picture yet"
STALE_SECONDS = 0.5  # an older picture does not show the present
UNSEEN_SECONDS = 2.0  # if the vehicle moves, routes must not depend on objects out of view for longer
LATE_SECONDS = 0.3  # a pilot who sees the motion of the arm with a larger delay must not drive it

ACKNOWLEDGE: Final = "'reset' acknowledges that"
RESET: Final = "'reset' lets the arm be driven again"
STOPPED: Final = f"STOP was pressed; {RESET}"

BY_HAND: Final = (MANOEUVRE, CHOOSING, PROPOSED)
ON_A_ROUTE: Final = "a route is being followed: 'next' makes its next move, 'stop' leaves it"

MAX_NUMBER = 1e6  # largest magnitude of a number in a command
MAX_WORD_LENGTH = 100  # characters of a word in a command


@dataclass(frozen=True, slots=True)
class Verb:
    """A command of the pilot: the function that executes it, and its preconditions. Stop, choose and leave have none.

    Attributes:
        act: Called with the `Means`, the `State`, and the command's arguments by their names, numbers as ``float`` and
            words as ``str``; returns the next `State`.
        present: Whether it needs the arm and an up-to-date picture.
        held: Whether the arm moves only while the command is renewed; the pilot must then see the arm.
        guided: Whether it leads the arm past objects without the pilot's judgement, so that all of them must be in
            view.
        gripping: Whether it is allowed while the gripper is closed on something fixed; consulted only if ``present``.
        modes: The modes in which it is allowed.
        otherwise: The refusal in all other modes.
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
    """How old the information on the pilot's page was when a command was given.

    The ages are computed from the time stamps that the page sends back with the command.

    Attributes:
        state: Age of the last state shown [s]; inf if the page does not say.
        picture: Age of the last camera picture shown [s]; inf if the page does not say.
        page: Number of the page; 0 for none.
    """

    state: float
    picture: float
    page: int = 0


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What is known of the arm and the scene at one moment.

    Attributes:
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        picture_age: Age of the last picture [s]; inf if there was none.
        past: Whether the pictures are photographs or a film and the arm is simulated: then no picture counts as stale.
        arm_off: How joint values and pictures contradict each other; "" if they do not.
        unusable: Why the last photograph or picture of a film could not be used; "" if it could.
        fault: What the arm did against its set points; "" if nothing, or if the pilot has acknowledged it.
        stopped: Whether STOP was pressed and has not been reset.
        arm_fault: What the arm says is wrong with itself; "" if nothing.
        arm_age: How old the joint values are at most [s].
        sight: What the pilot's page shows; None without a page.
        unseen: Which object of the scene has not been in view recently, in one line; "" if there is none.
    """

    arm_lost: str
    picture_age: float
    past: bool = False
    arm_off: str = ""
    unusable: str = ""
    fault: str = ""
    stopped: bool = False
    arm_fault: str = ""
    arm_age: float = 0.0
    sight: Sight | None = None
    unseen: str = ""

    @property
    def trouble(self) -> str:
        """Return why the present is not known, or why the arm cannot be trusted; "" if all is well."""
        if of_arm := self.arm_lost or self.arm_fault or self.fault or self.arm_off:
            return of_arm
        if self.arm_age > LATE_SECONDS:
            return f"the joints come from the arm more than {LATE_SECONDS:g} s late"
        if self.past or self.picture_age <= STALE_SECONDS:
            return self.unusable if self.past else ""
        return NO_PICTURE if self.picture_age == float("inf") else "the picture is stale"

    @property
    def blind(self) -> str:
        """Return why the pilot does not see the arm well enough to drive it; "" if he does."""
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
    """Return why a command is refused, in one line; "" if it is allowed.

    Args:
        verb: The command.
        mode: One of `MODES`.
        known: What is known at this moment.

    Example:
        >>> refusal(Verb(print, present=True), FOLLOWING, Knowledge("", picture_age=60.0))
        'refused: the picture is stale'
    """
    if mode not in verb.modes:
        return verb.otherwise

    if verb.present and known.trouble:
        return f"refused: {known.trouble}" + (f"; {ACKNOWLEDGE}" if known.trouble == known.fault else "")
    if verb.present and known.stopped:
        return f"refused: {STOPPED}"
    if verb.guided and known.unseen:
        return f"refused: {known.unseen}; bring it into view, or drive by hand"
    return f"refused: {known.blind}" if verb.held and known.blind else ""


# --- arguments of commands -------------------------------------------------------------------------------------------


def number(value: object, name: str) -> float:
    """Return a finite number of moderate size as ``float``.

    Raises:
        InputError: If the value is anything else.
    """
    plain = value.item() if isinstance(value, np.number) else value
    if isinstance(plain, bool) or not isinstance(plain, int | float) or not -MAX_NUMBER <= plain <= MAX_NUMBER:
        raise InputError(f"{name} must be a finite number, got {quoted(value)!r}")
    return float(plain)


def fitting(act: Callable[..., object], name: str, arguments: Mapping[str, object]) -> dict[str, float | str]:
    """Check the arguments of a command against the signature of its function, and return them converted.

    Args:
        act: The function. Its first two parameters are not arguments of the command; the others are annotated ``str``
            for words, and anything else for numbers.
        name: Name of the command, for messages.
        arguments: Values by name of the argument.

    Raises:
        InputError: If an argument is missing, unknown, or of another kind.
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
