"""Information about parameters where others are unknown too: nuisance parameters c, which stand behind the parameters theta.

With M = [[M_tt, M_tc], [M_ct, M_cc]] the information about theta is the Schur complement F = M_tt - M_tc M_cc^-1 M_ct. What is
known of c beforehand counts once in M_cc, however many points there are, so that F stays bounded.
"""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from ..noise.common_error import NOTHING_LEFT, beside_free


def marginal_rows(rows: Array, nuisance: int) -> Array:
    """Rows (r, p) whose Gram matrix is that of rows (m, p + nuisance), c marginalised: by QR, without squares.

    A QR would take a row for each c, also for one that no row notices, or that looks like another: then rows are projected.
    """
    if not nuisance:
        return rows
    ordered = np.concatenate([rows[:, -nuisance:], rows[:, :-nuisance]], axis=1)
    triangle = np.asarray(np.linalg.qr(ordered, mode="r"), dtype=np.float64)
    pivots = np.abs(np.diag(triangle))[:nuisance]
    if len(pivots) == nuisance and (pivots > NOTHING_LEFT * np.linalg.norm(triangle[:, :nuisance], axis=0)).all():
        return triangle[nuisance:, nuisance:]
    return beside_free(rows[None, :, None, :-nuisance], rows[None, :, None, -nuisance:])[0, :, 0]


def beside_nuisance(information: Array, nuisance: int) -> Array:
    """M (p + nuisance, p + nuisance) whose marginal information is F (p, p), with c known apart from theta."""
    if not nuisance:
        return information
    p = len(information)
    whole = np.eye(p + nuisance)
    whole[:p, :p] = information
    return whole
