"""How fast it is, next to what a user would take instead: ``python -m bench``.

Every claim is a ratio of times that were taken in turn in one run, at settings that meet the same accuracy; absolute times tell
of the machine. `workload` has the task and `accuracy` what is asked of a solution; `scipy_peer` and `scipy_stacked` are the other
side; `covariances`, `sensitivities`, `designs` and `memory` measure one thing each, and `tables` shows it. `peers` holds other
programs, with their own runner, and `scaling` the growth of the cost. `packs` runs the core's templates on other kinds of vectors,
and `cost` counts instructions.
"""

import os

# One core is one core: NumPy's linear algebra would take the others for SciPy's side. It reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
