"""Planning: `plan()` and `plan_many()`, their attempts, the second check, improvement and generated problems."""
