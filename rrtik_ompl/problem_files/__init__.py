"""The YAML of problems, scenes, goals and robots; MotionBenchMaker; messages of MoveIt."""
