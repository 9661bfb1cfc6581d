"""What a task does that its author may not have meant, in a line each."""

from __future__ import annotations

from itertools import product

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.contacts import measured
from rrtik_ompl.tasks.search import Done
from rrtik_ompl.tasks.stages import Attach
from rrtik_ompl.world.world import World

FAR = 0.05  # [m] between an object and what holds it, from which on that is said


def notes_of(done: Done) -> tuple[str, ...]:
    """What is odd about a way: objects attached from far away; and the contacts that its motions stood on."""
    notes = []
    stood_on = {id(branch): contacts for (branch, _), contacts in zip(done.motions, done.contacts, strict=True)}
    for branch in done.last.chain():
        notes += [f"{branch.step}: {branch.note}"] if branch.note else []
        notes += [f"{branch.step} stands on a contact: {each}" for each in stood_on.get(id(branch), ())]
        if branch.before is not None and branch.step is not None and isinstance(branch.step.stage, Attach):
            stage = branch.step.stage
            away = gap(branch.before.after.world, branch.q, stage.object, stage.link)
            if away > FAR:
                text = f"'{stage.object}' is {1e3 * away:.0f} mm away from '{stage.link}' when it is attached"
                notes.append(f"{branch.step}: {text}")
    return tuple(notes)


def gap(world: World, q: Vector, name: str, link: str) -> float:
    """Distance of an obstacle from a link and what is rigidly joined with it at q [m]; 0 where these have no solid."""
    robot, bodies = world.robot, world.bodies
    joint = robot.model.frames[robot.model.getFrameId(link)].parentJoint
    links = [k for k, body in enumerate(bodies) if body.joint == joint and body.name in robot.link_names]
    own = [k for k, body in enumerate(bodies) if body.name == name]
    pairs = measured(bodies, list(product(links, own)), robot.joint_frames(q[None])[0], near_only=False)
    return min((pair.distance for pair in pairs), default=0.0)
