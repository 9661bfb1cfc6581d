"""What obstacles and attached bodies are: frozen solids in their own frame, in metres (not how they collide).

``SHAPES`` has every kind by its key in files. Whoever adds one to it and to ``rrtik_ompl.collision.shape_table``,
before files are read, can use it like those that are here.
"""

from rrtik_ompl.shapes.half_space import HalfSpace
from rrtik_ompl.shapes.mesh import Mesh
from rrtik_ompl.shapes.primitives import Box, Capsule, Cylinder, Sphere
from rrtik_ompl.shapes.prism import Prism
from rrtik_ompl.shapes.shape import Measure, Shape, same_shape

SHAPES: dict[str, type[Shape]] = {kind.key: kind for kind in (Box, Sphere, Cylinder, Capsule, HalfSpace, Prism, Mesh)}

__all__ = [
    "SHAPES",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Measure",
    "Mesh",
    "Prism",
    "Shape",
    "Sphere",
    "same_shape",
]
