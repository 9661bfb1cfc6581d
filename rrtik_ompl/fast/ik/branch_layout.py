"""The tables of closed forms in kernels: what each field is, and the bounds that both forms of one arm go by."""

from __future__ import annotations

KERNELS = "ik.branch_kernels"  # their library
BRANCHES, DOF = 8, 6

# Arm. FROM_WORLD: T_base_world, TO_FRAME: T_tip_frame, 12 numbers each (rotation row by row, origin) · NUMBERS: what
# its kernel takes · LOWEST, HIGHEST: limits with their tolerance · TURNING: int32, whether a joint's limits go beyond
# half a turn · LIMB: address of the table of `ik_layout` that forward kinematics reads
FROM_WORLD, TO_FRAME, NUMBERS, LOWEST, HIGHEST, TURNING, LIMB = range(7)

# Call. ROWS: targets; BLOCKS: of WIDTH of them, the last one filled up · POSES: T_world_tip, 16 numbers each · NEAR:
# configurations, 6 numbers each, 0: none · SLACK: one number, see `AnalyticSolver` · the answers, targets last,
# WIDTH times BLOCKS of them: Q: joint values, joint by joint of each branch; REAL, FITS: of each branch, whether it
# reaches the target and whether it is inside the limits; ODD: whether the answer is not to be used; RESIDUALS: of each
# branch its distance, then of each its angle (0: not wanted) · SCRATCH: see below
ROWS, BLOCKS, POSES, NEAR, SLACK, Q, REAL, FITS, ODD, RESIDUALS, SCRATCH = range(11)

# Scratch memory, in wide lanes: TARGET as given and FRAME as the closed form wants it (12 each), the joint values of
# the HINT (6), SINES and COSINES of the joints
TARGET, FRAME, HINT, SINES, COSINES = 0, 12, 24, 30, 36
SCRATCH_LANES = 42

SINGULAR = 1e-10  # [m] or sine; nearer than this a pose counts as singular, and its answer is still good to 1e-9
DOUBLE_ROOT = 4e-14  # of a squared sine: less is rounding, whose square root would spoil a stretched arm by 1e-8
REACH_TOLERANCE = 1e-10  # in the cosine of an elbow: what rounding may add at a stretched arm

# Of arms of parallel axes
ROUNDING = 3e-16  # [m] of the wrist point: divided by its distance from the azimuth axis, of theta1 and so of h
NORMAL = 4e-10  # sine; largest deviation of the gripper axis from the arm plane's normal that counts as none
UNSURE = 1e-3  # sine; nearer to normal, rounding in psi can open a triangle that closes

# Of arms with a ball wrist
SHOULDER_ROOT = 1e-15  # [m^2] of a squared radius: less is rounding, which moves the wrist centre by less than 1e-14 m
