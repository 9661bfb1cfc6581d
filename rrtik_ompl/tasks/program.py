"""Number the stages of a task, as messages name them, and check them before anything is searched."""

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
    """Return stages with their numbers, each of which begins with the prefix."""
    return tuple(Step(f"{prefix}{k + 1}", stage) for k, stage in enumerate(stages))


def options_of(step: Step) -> tuple[tuple[Step, ...], ...]:
    """Return the rows of a step that has alternatives, as steps."""
    assert isinstance(step.stage, Alternatives), "only these have options"
    return tuple(steps_of(row, f"{step.number}.{k + 1}.") for k, row in enumerate(step.stage.options))


def check_program(steps: tuple[Step, ...], world: World) -> None:
    """Raise an error if a task can never be done, whatever is chosen.

    Raises:
        InputError: If something is attached twice, or detached while it is not held, or the robot has no gripper
            joints.
        UnknownNameError: If an object, link or posture does not exist.
    """
    _holds_after(steps, {frozenset(item.name for item in world.scene.attached)}, world)


def _holds_after(steps: tuple[Step, ...], possible_holds: set[Held], world: World) -> set[Held]:
    """Return which sets of objects may be held after some steps, and check the steps.

    Args:
        steps: The steps.
        possible_holds: The sets of names that may be held before them, one for each choice so far.
        world: The world at the beginning of the task.
    """
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
    """Return the names of what is held after an object is attached; raise an error if it is held already or unknown."""
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
    """Return the names of what is held after an object is detached; raise an error if it is not held."""
    if stage.object not in names_held:
        if stage.object not in world.scene.names:
            raise UnknownNameError("attached object", stage.object, world.scene.names)
        raise InputError(f"'{stage.object}' is not held here; attach it first")
    return names_held - {stage.object}


def _check_frames(stage: MoveTo, possible_holds: set[Held], world: World) -> None:
    """Raise an error unless each constraint's frame is one of the robot, or of an object always held."""
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
