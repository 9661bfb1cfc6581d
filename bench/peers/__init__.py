"""Libraries of others on our problems, one module of `libraries` each, all behind the same two faces.

A module about planning offers ``search(task)``, from a :class:`bench.peers.task.Task` to a function from a seed to a
path. It runs in a process of its own (``python -m bench.peers.libraries.roboplan``), for some peers need versions of
numpy and Pinocchio that exclude ours. A module about inverse kinematics offers ``solver(robot, start)``, from an arm to
a function from a pose to a configuration.
"""
