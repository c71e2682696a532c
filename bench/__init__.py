"""How fast it is, next to what a user would take instead: ``python -m bench``.

Every claim is a ratio of times that were taken in turn in one run, at settings that meet the same accuracy; absolute times tell
of the machine. `workload` has the task, `scipy_peer` the other side, and each of `covariances`, `sensitivities`, `designs` and
`memory` measures one thing and returns its figures as a dictionary.
"""
