"""Readers and writers of problems, scenes, goals and robots in YAML, MotionBenchMaker files and MoveIt messages."""
