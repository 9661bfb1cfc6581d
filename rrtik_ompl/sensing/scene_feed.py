"""Pictures of a camera as a feed of `replan`: a scene for each picture, all with the same obstacles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rrtik_ompl.errors import InputError
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.problem_from_view import scene_with
from rrtik_ompl.sensing.sensor import Sensor

REMEDY = "show every object of the marker map, or give the scene that holds it"


def scene_feed(
    pictures: Iterable[Picture], sensor: Sensor, scene: Scene | None = None
) -> Iterator[tuple[float, Scene]]:
    """Pairs of a time and a scene, as :func:`rrtik_ompl.replan` takes them; a live camera sets the pace of the run.

    Pictures are passed over until every object of the marker map has been seen once, for nobody knows where the others
    are. From then on an object that is out of view, or cannot be placed, stays where it was seen last.

    Args:
        pictures: In the order of time, such as ``pictures_from(source)``. The first that is used has the time 0.
        sensor: Detects the objects.
        scene: Further obstacles, none if None. An obstacle with the name of an object of the map has the pose that is
            given here until that object is seen.

    Raises:
        InputError: If the pictures end before everything was seen; it names what was not. If a picture cannot be used.
    """
    around = Scene(()) if scene is None else scene
    solids = [
        name for each in sensor.marker_map.objects if each.role not in ("base", "arm") for name in each.solid_names
    ]
    given, seen = {obstacle.name for obstacle in around.obstacles}, dict[str, Obstacle]()
    begin, why = None, ""
    for picture in pictures:
        view = sensor.view(picture)
        seen |= {solid.name: solid for each in view.placed for solid in each.solids()}
        if (given | seen.keys()).issuperset(solids):
            begin = picture.time if begin is None else begin
            yield picture.time - begin, scene_with(around, seen.values())
        why = view.why_not_placed
    if begin is None:
        lacking = [name for name in solids if name not in given | seen.keys()]
        what = ", ".join(lacking) or "any picture"
        raise InputError(f"scene feed: the pictures ended before this was seen: {what}; {why or REMEDY}")
