"""The state machine of a session: from a state and an event it computes the next state and a list of effects.

The table shows how the mode changes with each event. An empty cell means that the mode stays; it also stays when a
command is refused.

| event | manoeuvre | choosing | proposed | following |
|---|---|---|---|---|
| `object`, `grasp` | choosing | choosing | choosing | choosing |
| `plan`, `replan`: a route is found | proposed | proposed | proposed | proposed |
| the same, none is found; `reject` | manoeuvre, or choosing with a grasp | the same | the same | the same |
| `back`, with a route; `lift`, with something held | proposed | proposed | proposed | proposed (`lift`: refused) |
| `posture`: a route is found | proposed | proposed | proposed | refused |
| `together` | refused | refused | proposed | refused |
| `accept`: the rest is free | refused | refused | following | refused |
| `accept`, `next`: the rest is not free | refused | refused | proposed, withdrawn | proposed, withdrawn |
| `jog`, `go`, `move`, `servo`, `tool`, `lead`, `keep` | | | | refused |
| `close` on something loose, `open` with something | manoeuvre | manoeuvre | manoeuvre | refused |
| `next`, `settle` | refused | refused | refused | |
| `stop`, `halt`, `stand` | | | | proposed |
| `select`, `speed`, `release`, `reset`, `control` | | | | |
| measured: the last move is made, and nothing is driven | | | | manoeuvre |
| judged: picture or arm are not known any more | | | | proposed |
| judged: what the route stands on is out of view | | | | proposed |
| seen: the rest of the route is not free any more | | | proposed, withdrawn | proposed, withdrawn |

Driving is independent of the mode: the arm moves while a press is held (`Press`, `Drive`). The press ends, and the arm
stops, when it is not renewed in time, when the arm does not follow, when any other command is given, when something
comes into the way, and whenever the arm or the picture is no longer known. STOP latches: nothing moves until `reset`,
which also acknowledges what the arm did against its set points. Commands that are not allowed in a mode, or
whose preconditions are not met, are refused: see `interlock`.

To add a command, write its function, add a row to the `VERBS` of its module, and add a button to the page.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import frozen
from rrtik_ompl.base.errors import InputError, RrtikError, UnknownNameError
from rrtik_ompl.pilot import guide, postures
from rrtik_ompl.pilot.events import (
    Acknowledge,
    Broken,
    Command,
    Effect,
    Event,
    Failed,
    Judged,
    Measured,
    Reply,
    Said,
    Seen,
    Stop,
    TipSeen,
    Unusable,
    Write,
    WriteAnswer,
    alarm,
    news,
    refused,
)
from rrtik_ompl.pilot.interlock import (
    ACKNOWLEDGE,
    CHOOSING,
    FOLLOWING,
    MAX_WORD_LENGTH,
    NO_PICTURE,
    PROPOSED,
    RESET,
    Sight,
    Verb,
    fitting,
    refusal,
)
from rrtik_ompl.pilot.motion import hand, held, leading
from rrtik_ompl.pilot.queries import grasp_fault, known, out_of_view
from rrtik_ompl.pilot.state import Means, Pictures, State

# A reset this soon after a fault does not acknowledge it: the pilot cannot have read the message yet.
READ_SECONDS = 1.0
FIRST_WORDS = "choose a grasp with G and L, then plan with P; or a joint with 1 to 9, then hold an arrow key"


def handle(means: Means, state: State, event: Event) -> tuple[State, tuple[Effect, ...]]:
    """Return the state after an event, and the effects to carry out, in this order.

    The function has no side effects: the same state and event always give the same result.
    """
    after = _HANDLERS[type(event)](means, state, event)
    return replace(after, due=()), after.due


# --- commands --------------------------------------------------------------------------------------------------------


def goes_on(state: State, verb: str, press: object) -> bool:
    """Check whether a command renews the press that is held."""
    return verb in VERBS and VERBS[verb].held and state.press.is_of(verb, press)


def _command(means: Means, state: State, event: Command) -> State:
    """Execute a command. One that is not allowed in this mode, or on what is known, is refused with a message."""
    verb = event.verb
    press = event.arguments.get("press")
    now = replace(state, time=max(state.time, event.time), arm_lost=event.arm_lost, sight=event.sight)

    renewed = goes_on(now, verb, press)
    if renewed and now.press.over:
        return now  # the pilot was already told what ended the press

    holds = verb in VERBS and VERBS[verb].held
    given = replace(now, given=(verb, press if holds else None))
    after = _executed(means, given, event, renewed)
    return after if renewed else after.do(WriteAnswer(event.time))


def _executed(means: Means, state: State, event: Command, renewed: bool) -> State:
    """Check the command, its arguments and its preconditions, then call its function.

    Any command that is not held ends the present motion, except release, whose own message reports what remains of
    the move.
    """
    verb = event.verb
    try:
        if verb not in VERBS:
            raise UnknownNameError("command", verb[:MAX_WORD_LENGTH], VERBS)
        row = VERBS[verb]
        given = fitting(row.act, verb, event.arguments)
        why = guide.over(state, verb) or refusal(row, state.mode, known(means, state)) or hand.refusal(row, state)
        if why:
            raise InputError(why)

        if not row.held and verb != "release":  # `release` ends the motion itself
            state = state.released()
        if not renewed:
            values = {"name": verb, "arguments": given} | _who(event.sight)
            state = state.do(Write("command", event.time, values))
        return row.act(means, state, **given)
    except RrtikError as error:
        return held.refuse(state, str(error))


def _who(sight: Sight | None) -> dict[str, object]:
    """Return what the record says of the page of a command: its number, and the ages of what it had shown [s]."""
    if sight is None:
        return {}
    ages = {"seen": sight.state, "shown": sight.picture}
    return {"page": sight.page} | {key: round(age, 3) for key, age in ages.items() if np.isfinite(age)}


def _select(means: Means, state: State, joint: float) -> State:
    robot = means.robot
    number = int(joint)
    if not 0 <= number < robot.dof:
        raise InputError(f"joint must be 1 to {robot.dof}, got {number + 1}")
    return replace(state, selected=number).say(news(f"{robot.joint_names[number]} selected"))


def _object(_: Means, state: State, name: str) -> State:
    if state.around.named(name) is None:
        raise UnknownNameError("object in view", name, [each.object.name for each in state.around.seen])

    chosen = replace(state, target=name, choice=None, mode=CHOOSING)
    return chosen.say(news(f"{name} chosen; now a grasp"))


def _grasp(means: Means, state: State, type: str, level: float) -> State:
    state.around.check_grasp(state.target, type, int(level))
    chosen = replace(state, choice=(type, int(level)), mode=CHOOSING)

    fault = grasp_fault(means, chosen)
    place = f"{type} at level {int(level) + 1}"
    return chosen.say(refused(f"{place}: {fault}") if fault else news(f"{place}: can be reached"))


def _stop(_: Means, state: State) -> State:
    """Stop the arm; it does not move again until the pilot resets the stop."""
    stopped, said = _end_motion(replace(state, stopped=True))
    if state.fault:
        return stopped.say(alarm(f"stopped; {state.fault}; {ACKNOWLEDGE}"))
    return stopped.say(news(f"stopped: {RESET}{said.removeprefix('stopped')}"))


def _reset(_: Means, state: State) -> State:
    """Let the arm be driven again after STOP; acknowledge a fault if the pilot has had time to read it."""
    if not state.stopped and not state.fault:
        return state.say(refused("there is nothing to reset"))
    if state.fault and state.time - state.fault_at <= READ_SECONDS:
        return state.say(alarm(f"{state.fault}; read this, then 'reset' again"))

    free = replace(state.stand_still(), stopped=False)
    if state.fault:  # a fault found since the last `Judged` stays: nobody has read it yet
        free = replace(free, fault="").do(Acknowledge())
    return free.say(news("reset: the arm can be driven again; it stands still"))


def _stand(_: Means, state: State) -> State:
    """Stop the arm as the session itself once did: a record says so, and a replay, which sees no trouble, does it."""
    return _end_motion(state)[0]


def _halt(_: Means, state: State) -> State:
    """Stop the arm because no page has the role of the pilot any more."""
    return _end_motion(state)[0].say(alarm("the pilot has left; the arm stands still"))


def _control(_: Means, state: State) -> State:
    """Greet a page that has become the pilot."""
    waits = f"; {RESET}" if state.stopped or state.fault else f": {FIRST_WORDS}"
    return state.say(news(f"you have control, and the arm stands still{waits}"))


def _end_motion(state: State) -> tuple[State, str]:
    """Stop the arm, and stop following a route.

    Returns:
        The new state, and the message for the pilot.
    """
    stopped = replace(state.stand_still(), desired=state.q)
    if state.mode != FOLLOWING:
        return stopped, "stopped"
    return replace(stopped, mode=PROPOSED), "stopped; 'accept' goes on with the route, 'reject' leaves it"


VERBS: dict[str, Verb] = {
    "select": Verb(_select),
    "object": Verb(_object),
    "grasp": Verb(_grasp),
    "stop": Verb(_stop),
    "reset": Verb(_reset),
    "stand": Verb(_stand),
    "halt": Verb(_halt),
    "control": Verb(_control),
    **held.VERBS,
    **guide.VERBS,
    **hand.VERBS,
    **leading.VERBS,
    **postures.VERBS,
}


# --- what is seen and measured ---------------------------------------------------------------------------------------


def _seen(_: Means, state: State, event: Seen) -> State:
    """Update the surroundings by the objects of a picture, and stop what is no longer free.

    The first graspable object that is seen becomes the target if none is chosen.
    """
    at = {**state.pictures.seen_at, **{each.object.name: event.time for each in event.objects}}
    if state.holds:
        at[state.holds] = event.time  # a held object moves with the arm, so it counts as seen
    now = replace(state, time=max(state.time, event.time), pictures=Pictures(event.time, "", at))

    around = state.around.see(event.objects)
    if around is state.around:
        return now

    target = state.target
    if target is None:
        graspable = (each.object for each in event.objects if each.object.role == "target" and each.object.grasps)
        target = next((each.name for each in graspable), None)

    changed = replace(now, around=around, target=target)
    return _check_motion(changed.do(Write("seen", event.time, {"objects": around.places()})))


def _tip_seen(means: Means, state: State, event: TipSeen) -> State:
    """Compare the pose of the tip in a picture with the joint values; a contradiction blocks all motion."""
    if means.past:
        return state
    check = state.check.see(event.T_base_tip, event.covariance, means.robot.fk(state.q), event.time)
    return replace(state, check=check)


def _unusable(_: Means, state: State, event: Unusable) -> State:
    return replace(state, pictures=replace(state.pictures, unusable=event.why))


def _measured(means: Means, state: State, event: Measured) -> State:
    """Store the configuration that was read, and end a press that was not renewed in time."""
    now = replace(
        state,
        time=max(state.time, event.time),
        arm_lost=event.arm_lost,
        arm_fault=event.arm_fault,
        arm_age=event.arm_age,
        q=frozen(event.q),
    )
    if not np.array_equal(state.q, now.q):
        now = now.do(Write("joints", event.time, {"q": now.q.tolist()}))
        around = now.around.settle(now.q)
        now = now if around is now.around else _check_motion(replace(now, around=around))

    now = replace(now, check=now.check.read(now.q, event.time))
    now, expired = held.expire(now)
    return now if means.recorded else now.say(expired)  # a replayed record holds this message already


def _judged(means: Means, state: State, event: Judged) -> State:
    """Stop the arm if it errs or if the present is no longer known; otherwise update its progress."""
    state = replace(held.watch(means, state, event.standing), fault=event.fault)

    state = _watch(means, state)
    state = _watch_view(means, state)
    return guide.watch(means, state)


def _watch(means: Means, state: State) -> State:
    """Stop and leave the route when the picture or the arm is lost; report when both are known again."""
    trouble = known(means, state).trouble
    if trouble == state.trouble:
        return state

    named = trouble == state.fault
    how = f"; {ACKNOWLEDGE}" if named else ""
    now = replace(
        state,
        trouble=trouble,
        fault_at=state.time if named else state.fault_at,
        stopped=state.stopped or bool(state.arm_fault),  # what has stopped the arm at its side needs a reset here, too
    )

    if not trouble:
        waits = RESET if now.stopped else "the arm stands still"
        if state.trouble == NO_PICTURE and not now.stopped:
            return now.say(news(f"ready: {FIRST_WORDS}"))
        return now.say(news(f"picture and arm are known again; {waits}"))
    if state.mode != FOLLOWING and not state.drive.active:
        return now.do(Stop()).say(alarm(trouble + how))

    stopped, said = _end_motion(now)
    return _write_stop(stopped).say(alarm(f"{trouble}: {said}{how}"))


def _watch_view(means: Means, state: State) -> State:
    """Leave the route when an object that it depends on has been out of view too long; report when all are seen."""
    unseen = out_of_view(means, state)
    now = replace(state, unseen=unseen)
    if bool(unseen) == bool(state.unseen):
        return now
    if not unseen:
        return now.say(news("all that routes stand on is in view"))

    if state.mode != FOLLOWING:
        return now.say(alarm(f"{unseen}: no route is led past it, and by hand it may be elsewhere"))

    stopped, said = _end_motion(now)
    return _write_stop(stopped).say(alarm(f"{unseen}: {said}"))


def _write_stop(state: State) -> State:
    """Record that the session stopped: a replay, whose arm and pictures are never lost, would not do so by itself."""
    return state.do(Write("command", state.time, {"name": "stand", "arguments": {}}))


def _check_motion(state: State) -> State:
    """Stop the arm after a change of the scene if the motion that is driven, followed or proposed is no longer free."""
    if state.mode != FOLLOWING and not held.still_free(state):
        state = state.released().say(alarm("stopped: something has come into the way"))
    return guide.check(state)


# --- the others ------------------------------------------------------------------------------------------------------


def _said(_: Means, state: State, event: Said) -> State:
    return state.say(event.answer)


def _broken(_: Means, state: State, event: Broken) -> State:
    return state.stand_still()


def _reply(means: Means, state: State, event: Reply) -> State:
    """Continue a command with the answer to its effect."""
    try:
        return event.then(means, state, event.answer)
    except RrtikError as error:
        return held.refuse(state, str(error))


def _failed(_: Means, state: State, event: Failed) -> State:
    """Refuse the command whose effect could not be carried out."""
    return held.refuse(state, event.why)


_HANDLERS: dict[type, Callable[[Means, State, Any], State]] = {
    Command: _command,
    Measured: _measured,
    Judged: _judged,
    Seen: _seen,
    TipSeen: _tip_seen,
    Unusable: _unusable,
    Said: _said,
    Broken: _broken,
    Reply: _reply,
    Failed: _failed,
}
