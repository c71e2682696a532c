"""A case for the checks of the random campaign whose runs cross jumps and kinks."""

from __future__ import annotations

from random_models import Case


def crossing_case(seed: int, also: str) -> Case:
    """Two states with a jump and two kinks, on grids for odd seeds; `also` names the check."""
    return Case(
        rates=("2*(u1 - sign(x1 - 0.8)*p1*0.5 - x1*x2)", "u2*x1 - p2*max(x2 - 1, 0.2*u1) - 0.3*abs(x1 - u2)"),
        outputs=("x1 + 0.1*u1", "x2"),
        state_sizes=(1.0, 1.0),
        input_sizes=(1.0, 1.0),
        parameter_sizes=(1.0, 1.0),
        relative_std=(0.1, 0.1),
        log=(False, False),
        seed=seed,
        grid=bool(seed % 2),
        also=also,
    )
