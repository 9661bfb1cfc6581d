"""Convert pictures of a camera to a feed for `replan`: one scene for each picture, all with the same obstacles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.scene_from_view import scene_with
from rrtik_ompl.sensing.sensor import Sensor

REMEDY = "show every object of the marker map, or give the scene that holds it"


def scenes_of_pictures(pictures: Iterable[Picture], sensor: Sensor, scene: Scene | None = None) -> Iterator[Snapshot]:
    """Yield a snapshot of time and scene for each picture, as :func:`rrtik_ompl.replan` takes them.

    Pictures are skipped until every object of the marker map has been seen once, because the places of the others are
    unknown until then. From then on, an object that is out of view, or cannot be located, stays at its last pose, and
    the snapshot says for how long it has been unseen. Obstacles that are not tracked by the camera are at rest. A live
    camera sets the pace of the run.

    Args:
        pictures: In the order of time, such as ``pictures_from(source)``. The first one that is used has the time 0.
        sensor: Detects the objects.
        scene: Further obstacles; None for none. An obstacle with the name of an object of the map defines the object's
            pose until the object is seen.

    Raises:
        InputError: If the pictures end before everything was seen; it names what was not. If a picture cannot be used.

    Example:
        >>> import rrtik_robots
        >>> shipped = f"{rrtik_robots.__path__[0]}/problems/pilot"
        >>> camera = rrtik.sensing.Camera.load(f"{shipped}/camera_640.yaml")
        >>> marker_map = rrtik.sensing.MarkerMap.load(f"{shipped}/titan4_panel_markers.yaml")
        >>> pictures = [picture for (picture,) in rrtik.sensing.pictures_together([f"{shipped}/photographs"])]
        >>> feed = rrtik.sensing.scenes_of_pictures(pictures, rrtik.sensing.Sensor(camera, marker_map))
        >>> next(feed).time
        0.0
    """
    try:
        stream = iter(pictures)
    except TypeError:
        kind = type(pictures).__name__
        raise InputError(f"pictures of a scene feed must be a list, got {kind}; use pictures_from(source)") from None
    require(sensor, Sensor, "sensor of a scene feed", "use Sensor(camera, marker_map)")
    require(scene, Scene | None, "scene of a scene feed", "use load_scene(file)")
    given_scene = Scene(()) if scene is None else scene
    solids = [
        name for each in sensor.marker_map.objects if each.role not in ("base", "arm") for name in each.solid_names
    ]
    given = {obstacle.name for obstacle in given_scene.obstacles}

    seen = dict[str, Obstacle]()
    around = replace(given_scene, obstacles=tuple(_at_rest(o, solids) for o in given_scene.obstacles))

    begin = None
    why = ""
    last = dict[str, float]()  # time at which each was seen last

    for picture in stream:
        require(picture, Picture, "picture of a scene feed", "use pictures_from(source)")
        view = sensor.view(picture)
        now = {solid.name: solid for each in view.placed for solid in each.solids()}
        seen |= now
        last |= dict.fromkeys(now, picture.time)

        if (given | seen.keys()).issuperset(solids):
            begin = picture.time if begin is None else begin
            ages = {name: picture.time - last.get(name, begin) for name in solids if name not in now}
            unseen = {name: max(age, 0.0) for name, age in ages.items()}  # pictures may be out of order
            yield Snapshot(picture.time - begin, scene_with(around, seen.values()), unseen)

        why = view.why_not_placed

    if begin is None:
        lacking = [name for name in solids if name not in given | seen.keys()]
        what = ", ".join(lacking) or "any picture"
        raise InputError(f"scene feed: the pictures ended before this was seen: {what}; {why or REMEDY}")


def _at_rest(obstacle: Obstacle, seen: list[str]) -> Obstacle:
    """Return an obstacle with zero velocity, unless it is tracked by the camera or already has a motion."""
    known = obstacle.name in seen or obstacle.motion is not None
    return obstacle if known else replace(obstacle, motion=ConstantVelocity([0.0, 0.0, 0.0]))
