"""What kernels answer, again in plain numpy: it judges them in tests, and answers on machines that have none.

Some twins stand with what they are a part of: proofs of motions (`kernels/proof/in_numpy.py`), whose bounds are here;
the branches of a closed form (`ik/analytic/branches.py`), as its singular poses are always answered by numpy; a tip
that follows a rail (`planning/tip_motion/following.py`); RRT-Connect and roadmaps in Python (`planning/search/`), which
also search in worlds of which kernels know nothing; how solids are covered (`kernels/covers/`), which the tables of
kernels need.
"""
