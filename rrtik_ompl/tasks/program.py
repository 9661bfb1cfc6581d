"""A task as a program: its stages with the numbers that messages call them by, checked before anything is searched."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.tasks.setting import with_gripper
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, Gripper, MoveTo, Stage
from rrtik_ompl.world.world import World

Held = frozenset[str]


@dataclass(frozen=True, slots=True)
class Step:
    """A stage and its number, such as "3", or "3.2.1" for the first stage of the second alternative of stage 3."""

    number: str
    stage: Stage

    def __str__(self) -> str:
        return f"stage {self.number} ({self.stage})"


def steps_of(stages: Iterable[Stage], prefix: str = "") -> tuple[Step, ...]:
    """Stages with their numbers."""
    return tuple(Step(f"{prefix}{k + 1}", stage) for k, stage in enumerate(stages))


def options_of(step: Step) -> tuple[tuple[Step, ...], ...]:
    """The rows of a step that has alternatives."""
    assert isinstance(step.stage, Alternatives), "only these have options"
    return tuple(steps_of(row, f"{step.number}.{k + 1}.") for k, row in enumerate(step.stage.options))


def check_program(steps: tuple[Step, ...], world: World) -> None:
    """Refuse what can never be done, whatever is chosen.

    Raises:
        InputError: If something is attached twice or detached where it is not, or the robot has no gripper joints.
        UnknownNameError: If there is no object, link or posture of a name.
    """
    _holds_after(steps, {frozenset(item.name for item in world.scene.attached)}, world)


def _holds_after(steps: tuple[Step, ...], possible_holds: set[Held], world: World) -> set[Held]:
    """What may be held after some steps; ``possible_holds``: what may be held before, a set for each choice so far."""
    for step in steps:
        stage = step.stage
        try:
            if isinstance(stage, Alternatives):
                possible_holds = set().union(*(_holds_after(row, possible_holds, world) for row in options_of(step)))
            elif isinstance(stage, Attach):
                possible_holds = {_holds_after_attach(stage, names_held, world) for names_held in possible_holds}
            elif isinstance(stage, Detach):
                possible_holds = {_holds_after_detach(stage, names_held, world) for names_held in possible_holds}
            elif isinstance(stage, Gripper):
                with_gripper(world.robot, stage)
            elif isinstance(stage, MoveTo):
                _check_goal(stage, world)
                _check_frames(stage, possible_holds, world)
        except InputError as error:
            if not str(error).startswith("stage "):
                raise InputError(f"{step}: {error}") from None
            raise
    return possible_holds


def _holds_after_attach(stage: Attach, names_held: Held, world: World) -> Held:
    """What is held once something is attached; refuses what is held already, and unknown names."""
    if stage.object in names_held:
        raise InputError(f"'{stage.object}' is held already; detach it first")
    if stage.object not in world.scene.names:
        raise UnknownNameError("obstacle", stage.object, world.scene.names)

    links = world.robot.link_names
    if stage.link not in links:
        raise UnknownNameError(f"link of robot '{world.robot.name}'", stage.link, links)
    for name in stage.allow:
        if name not in links and name not in world.scene.names:
            raise UnknownNameError("link or obstacle", name, (*links, *world.scene.names))
    return names_held | {stage.object}


def _holds_after_detach(stage: Detach, names_held: Held, world: World) -> Held:
    """What is held once something is detached; refuses what is not held."""
    if stage.object not in names_held:
        if stage.object not in world.scene.names:
            raise UnknownNameError("attached object", stage.object, world.scene.names)
        raise InputError(f"'{stage.object}' is not held here; attach it first")
    return names_held - {stage.object}


def _check_frames(stage: MoveTo, possible_holds: set[Held], world: World) -> None:
    model = world.robot.model
    for region in stage.constraints:
        name = region.frame
        if name is None or model.existFrame(name):
            continue
        if name not in world.scene.names:
            raise UnknownNameError("frame of a constraint", name, (*world.robot.link_names, *world.scene.names))
        if not all(name in names_held for names_held in possible_holds):
            raise InputError(f"the constraint's frame '{name}' is not held here; attach it first")


def _check_goal(stage: MoveTo, world: World) -> None:
    if isinstance(stage.goal, str):
        world.robot.posture(stage.goal)
    elif not hasattr(stage.goal, "satisfied"):
        world.robot.configuration(stage.goal, "goal")
