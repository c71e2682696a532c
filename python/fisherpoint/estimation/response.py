"""What data would have been at given unknowns, with the derivatives by them."""

from __future__ import annotations

from typing import NamedTuple

from ..quantity import Array, IntArray


class Response(NamedTuple):
    """Of B sets of P unknowns and N samples: y (B, N, n_y), dy (B, N, n_y, P), SI units, and status (B,) of the worst sample.

    Where the status is not ok, y and dy are zero.
    """

    y: Array
    dy: Array
    status: IntArray
