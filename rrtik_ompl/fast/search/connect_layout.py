"""The table of an RRT-Connect search in kernels: what each field is, and the words for its states."""

from __future__ import annotations

KERNELS = "search.connect_kernels"  # the library of these searches

# Search: what it works on (the trees: from the starts, from the goals) ...
WORLD, TREES, _, DOF, JOINTS, GAIN, OFFSET, LOWER, UPPER, WEIGHTS, NUMBERS, INVERSES = range(12)
# ... its rules ...
RESOLVE, PATIENCE, LIMIT, START_ROWS, GOAL_ROWS = range(12, 17)
# ... the motion that it looks at: from vertex FROM of tree GROWING to ROW (joint values ROW_VALUES); a BRIDGE ends at
# vertex TARGET of the other tree ...
PHASE, GROWER, GROWING, FROM, TARGET, BRIDGE, ROW, ROW_VALUES, QUERY, POINT, RANDOM = range(17, 28)
# ... where the trees meet, and what is asked ...
MEETINGS, _MEETING, MEETING_OPEN, ASKED, QUESTIONS, QUESTION_STARTS, QUESTION_ENDS = range(28, 35)
QUESTION_TREES, QUESTION_VERTICES, ANSWERS = range(35, 38)
# ... and counts.
ITERATIONS, REJECTED, CHECKED, ROOTS, STRAIGHT_TRIED = range(38, 43)
# Samples lie in the box around CENTRE whose sides are twice the number SPREAD, which grows with every sample.
CENTRE, FIELD_COUNT = range(43, 45)

RANGE, DOMAIN, RESOLUTION, STEPS_PER_UNIT, SPREAD = range(5)  # the numbers
EVERYWHERE = 1e30  # the spread of samples that lie in the whole box
STRAIGHT, SAMPLE, CONNECT = range(3)  # phases
NOTHING, MOTION, PATH = range(3)  # what is asked
SOLVED, EXHAUSTED, RUNNING, ASKING, FULL = range(5)  # status
MOST_QUESTIONS = 64
