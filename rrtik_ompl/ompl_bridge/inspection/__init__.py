"""What a planner tells of itself: its options, what it has grown, and both in the logs of OMPL's Benchmark."""
