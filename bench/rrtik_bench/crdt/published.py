"""The tables of [1, ch. 6.3] that the report stands beside."""

# Environment E, 1000 runs each: mean, minimum, maximum, deviation of iterations, vertices, collision checks, seconds.
RRT_TABLE = (
    (604.40, 422.07, 2973.21, 45.57),
    (106, 47, 484, 2.59),
    (2000, 1571, 7361, 99.98),
    (303.79, 240.37, 1137.67, 30.87),
)
CRDT_TABLE = (
    (232.47, 383.63, 2714.50, 33.25),
    (2, 5, 261, 1.02),
    (1897, 3238, 9561, 98.85),
    (233.76, 395.06, 1461.48, 22.76),
)
# The final list of moves of the SDU test in [1, ch. 6.3], degrees as printed.
SDU_LIST: list[list[float]] = [
    [25, 19, -82, 60, 90, 0],
    [48.19, 19, -82, 60, 90, 0],
    [48.19, 19, -82, 60, 80, 0],
    [48.19, 19, -82, 80, 80, 0],
    [48.19, 19, -122, 80, 80, 0],
    [48.19, 54.90, -122, 80, 80, 0],
    [10, 54.90, -122, 80, 80, 0],
    [10, 41, -122, 80, 80, 0],
]

# The route of the prism test, degrees as printed.
PRISM_LIST: list[list[float]] = [
    [0, 0, 0, 0, 90, 0],
    [0, 0, 95.13, 0, 90, 0],
    [-30, 0, 95.13, 0, 90, 0],
    [-30, 0, 0, 0, 90, 0],
]

# RRT-Connect on the prisms, table 6.6, degrees as printed.
CONNECT_LIST: list[list[float]] = [
    [0, 0, 0, 0, 90, 0],
    [-7.73, 24.42, 18.64, 0.64, 81.13, -69.05],
    [-37.94, 15.77, 3.761, -0.70, 70.10, -43.18],
    [-30, 0, 0, 0, 90, 0],
]
