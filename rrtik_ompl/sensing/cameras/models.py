"""Names of the lens models; the models themselves, in `lenses`, load OpenCV."""

from enum import Enum


class Model(str, Enum):
    """The lens models."""

    brown = "brown"
    rational = "rational"
    fisheye = "fisheye"
