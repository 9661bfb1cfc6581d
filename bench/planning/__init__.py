"""MotionBenchMaker's problems, and the results of campaigns."""
