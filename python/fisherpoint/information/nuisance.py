"""Information about parameters where others are unknown too: nuisance parameters c, which stand behind the parameters theta.

With M = [[M_tt, M_tc], [M_ct, M_cc]] the information about theta is the Schur complement F = M_tt - M_tc M_cc^-1 M_ct. What is
known of c beforehand counts once in M_cc, however many points there are, so that F stays bounded.
"""

from __future__ import annotations

import numpy as np

from ..basics.values import Array


def marginal_rows(rows: Array, nuisance: int) -> Array:
    """Rows (r, p) whose Gram matrix is that of rows (m, p + nuisance), c marginalised: by QR, without squares."""
    if not nuisance:
        return rows
    ordered = np.concatenate([rows[:, -nuisance:], rows[:, :-nuisance]], axis=1)
    return np.asarray(np.linalg.qr(ordered, mode="r"), dtype=np.float64)[nuisance:, nuisance:]


def beside_nuisance(information: Array, nuisance: int) -> Array:
    """M (p + nuisance, p + nuisance) whose marginal information is F (p, p), with c known apart from theta."""
    if not nuisance:
        return information
    p = len(information)
    whole = np.eye(p + nuisance)
    whole[:p, :p] = information
    return whole
