"""All programs of a model, from its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

from .differentiate import gradient, rates_along
from .from_sympy import nodes_of
from .graph import Graph, Leaves
from .program import Program
from .reset import Reset
from .schedule import schedule
from .update import Update

LIMIT = 1000
"""The most states and parameters: derivatives of larger models would fill the memory."""

MOST_SURFACES = 256
"""The most switching surfaces."""

MOST_RESETS = 32
"""The most resets that the core takes."""

MOST_UPDATES = 30
"""The most updates that the core takes."""

Entries = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Programs:
    """Programs by which the core runs a model.

    Entries (i, k) are places of derivatives of component i by variable k: state k for k < n_x, else parameter k - n_x. Those by
    states come first, sorted by (i, k), then those by parameters, sorted by (k, i).

    Attributes
    ----------
    rates, output : Program
        f (n_x) and g (n_y).
    surfaces, surface_rates : Program
        Values of jumps, kinks and domain limits, and their rates of change where the state moves at the rate dx.
    state_jacobian : Program
        The derivatives of f by the states at its entries, for implicit steps.
    rate_jacobian, output_jacobian, jump_jacobian : Program
        f, g or what is zero on jumps and steep kinks, followed by its derivatives at the entries.
    state_entries : tuple of (int, int)
        Derivatives of f by the states that are not zero by structure.
    rate_entries, output_entries, jump_entries : tuple of (int, int)
        Derivatives that are not zero by structure, without those by states that no parameter ever reaches; of f also what it reads
        through the sides of jumps.
    varying_states, varying_outputs, varying_surfaces : tuple of bool
        Whether each state, output, and jump or kink depends on any parameter, in whatever way: by branches too.
    crossable : tuple of bool
        Whether trajectories can cross each jump.
    rough : tuple of bool
        Whether f takes a root of what is zero on each jump or kink: beside it derivatives of f change fast.
    steep : tuple of bool
        Whether derivatives of f have no bounds there.
    closed : tuple of bool
        Of each domain limit that is no pole and not measured, whether f has a value where it is zero.
    constant_slopes : tuple of bool
        Of each of `rate_entries`, whether it is constant along a trajectory that stays on its sides of the jumps: it reads neither
        states nor sides of kinks.
    poles : int
        How many of the domain limits, the first ones, are denominators of either sign.
    measured : int
        How many, the last ones, are of g alone.
    reset_count : int
        How often states are set anew by different conditions.
    resets, reset_jacobian : Program
        The conditions, by sides, positive where they hold, and then the values of the targets; these values and their derivatives.
    reset_targets, reset_entries : tuple of (int, int)
        (reset, state) of each target, and (target, variable) of each derivative.
    reset_levels : tuple of bool
        Whether each reset counts at a start too where its condition holds.
    update_count : int
        How many updates set states anew at known times.
    updates, update_jacobian : Program
        The values of their targets; these values and their derivatives.
    update_targets, update_entries : tuple of (int, int)
        (update, state) of each target, and (target, variable) of each derivative.
    """

    rates: Program
    output: Program
    surfaces: Program
    surface_rates: Program
    state_jacobian: Program
    rate_jacobian: Program
    output_jacobian: Program
    jump_jacobian: Program
    state_entries: Entries
    rate_entries: Entries
    output_entries: Entries
    jump_entries: Entries
    varying_states: tuple[bool, ...]
    varying_outputs: tuple[bool, ...]
    varying_surfaces: tuple[bool, ...]
    crossable: tuple[bool, ...]
    rough: tuple[bool, ...]
    steep: tuple[bool, ...]
    closed: tuple[bool, ...]
    constant_slopes: tuple[bool, ...]
    poles: int
    measured: int
    reset_count: int
    resets: Program
    reset_jacobian: Program
    reset_targets: Entries
    reset_entries: Entries
    reset_levels: tuple[bool, ...]
    update_count: int
    updates: Program
    update_jacobian: Program
    update_targets: Entries
    update_entries: Entries


@dataclass(frozen=True)
class Surfaces:
    """Jumps and kinks of f, and limits of the domain of f and g.

    Attributes
    ----------
    values : sequence of sympy.Expr
        What is zero on jumps and kinks, in the order of `sides`, where a side is the sign of its surface's value; then what must
        stay positive, where it is the side on which the trajectory runs.
    sides : sequence of sympy.Symbol
        For each jump and kink the symbol that stands for the side it is on, +1 or -1, in the branches of f.
    poles : int
        How many of the domain limits, the first ones, are denominators of either sign.
    measured : int
        How many, the last ones, are of g alone, and hold where it is measured.
    crossable : sequence of bool
        For each jump, which are the first of the surfaces, whether trajectories can cross it.
    rough : sequence of bool
        For each jump and kink, whether f takes a root of what is zero on it; none for nowhere.
    steep : sequence of bool
        For each, whether derivatives of f have no bounds there; none for nowhere. Such kinks come before others.
    closed : sequence of bool
        Of each domain limit that is no pole and not measured, whether f has a value where it is zero; none for nowhere.
    """

    values: Sequence[Any] = ()
    sides: Sequence[Any] = ()
    poles: int = 0
    measured: int = 0
    crossable: Sequence[bool] = ()
    rough: Sequence[bool] = ()
    steep: Sequence[bool] = ()
    closed: Sequence[bool] = ()


def build_programs(
    rates: Sequence[Any],
    output: Sequence[Any],
    surfaces: Surfaces,
    states: Sequence[Any],
    inputs: Sequence[Any],
    parameters: Sequence[Any],
    constants: Mapping[Any, float] | None = None,
    resets: Sequence[Reset] = (),
    delays: Sequence[tuple[Any, Any]] = (),
    updates: Sequence[Update] = (),
) -> Programs:
    """Programs of x' = f(x, u, theta), y = g(x, u, theta).

    Parameters
    ----------
    rates, output : sequence of sympy.Expr
        f, one for each state, and g.
    surfaces : Surfaces
    states, inputs, parameters : sequence of sympy.Symbol
    constants : mapping from sympy.Symbol to float
        Known constants.
    resets : sequence of Reset
        Where states are set anew: what becomes positive, of sides, states with what they are set to, and whether it counts at a
        start too.
    delays : sequence of (sympy.Symbol, sympy.Symbol)
        Inputs that switch in instants which are parameters, and these: the states depend on them.
    updates : sequence of Update
        States that are set anew at known times.

    Raises
    ------
    ValueError
        For lengths that do not fit, too many states, parameters or surfaces, an output that reads a side, and what cannot be
        expressed: an unknown symbol or function.
    """
    constants, sides = constants or {}, surfaces.sides
    _check(rates, surfaces, states, parameters)
    leaves = Leaves(len(parameters), len(inputs), len(states), len(sides))
    graph = Graph(leaves)
    symbols = dict(zip([*parameters, *inputs, *states, *sides], range(leaves.dx.start), strict=True))
    symbols |= {symbol: graph.literal(float(value)) for symbol, value in constants.items()}
    if len(symbols) < leaves.dx.start + len(constants):
        raise ValueError("symbols: expected each to be one of states, inputs, parameters, sides and constants, given one twice")
    f, g = (nodes_of(graph, expressions, symbols) for expressions in (rates, output))
    h = _by_value(graph, surfaces.values, sides, symbols)
    for i, node in enumerate(g):
        if _reads_any(graph, node, leaves.side):
            raise ValueError(f"output: expected no side of a surface, given {output[i]}")

    anew = _Resets(graph, resets, symbols, h[: len(sides)])
    timed = _Updates(graph, updates, symbols)
    instants = [(symbols[u], symbols[tau]) for u, tau in delays]
    switched = [
        reduce(
            or_, (1 << tau for u, tau in instants if (_through_sides(graph, node, h[: len(sides)]) | anew.reads(leaf)) >> u & 1), 0
        )
        for leaf, node in zip(leaves.x, f, strict=True)
    ]
    also = [by | timed.reads(leaf) for leaf, by in zip(leaves.x, switched, strict=True)]
    variables = [*_reached(graph, f, h[: len(sides)], anew, also), *leaves.theta]
    jumps = len(surfaces.crossable)
    through = [_read_through(graph, node, h[:jumps]) | anew.read_through(i, node) | also[i] for i, node in enumerate(f)]
    state_entries, state_nodes = _entries(graph, f, leaves.x)
    rate_entries, rate_nodes = _entries(graph, f, variables, through)
    output_entries, output_nodes = _entries(graph, g, variables)
    watched = jumps + sum(surfaces.steep[jumps:])
    jump_entries, jump_nodes = _entries(graph, h[:watched], [*leaves.x, *leaves.theta])
    reset_entries, reset_nodes = _entries(graph, anew.values, variables)
    update_entries, update_nodes = _entries(graph, timed.values, variables)
    return Programs(
        rates=schedule(graph, f),
        output=schedule(graph, g),
        surfaces=schedule(graph, h),
        surface_rates=schedule(graph, rates_along(graph, h)),
        state_jacobian=schedule(graph, state_nodes),
        rate_jacobian=schedule(graph, f + rate_nodes),
        output_jacobian=schedule(graph, g + output_nodes),
        jump_jacobian=schedule(graph, h[:watched] + jump_nodes),
        state_entries=state_entries,
        rate_entries=rate_entries,
        output_entries=output_entries,
        jump_entries=jump_entries,
        varying_states=tuple(leaf in variables for leaf in leaves.x),
        varying_outputs=tuple(_reads_any(graph, node, variables) for node in g),
        varying_surfaces=tuple(_reads_any(graph, node, variables) for node in h[: len(sides)]),
        crossable=tuple(surfaces.crossable),
        rough=tuple(surfaces.rough) or (False,) * len(sides),
        steep=tuple(surfaces.steep) or (False,) * len(sides),
        closed=tuple(surfaces.closed) or (False,) * (len(surfaces.values) - len(sides) - surfaces.poles - surfaces.measured),
        constant_slopes=tuple(not _reads_any(graph, node, [*leaves.x, *leaves.side[jumps:]]) for node in rate_nodes),
        poles=surfaces.poles,
        measured=surfaces.measured,
        reset_count=len(resets),
        resets=schedule(graph, anew.conditions + anew.values),
        reset_jacobian=schedule(graph, anew.values + reset_nodes),
        reset_targets=tuple(anew.targets),
        reset_entries=reset_entries,
        reset_levels=tuple(reset.by_level for reset in resets),
        update_count=len(updates),
        updates=schedule(graph, timed.values),
        update_jacobian=schedule(graph, timed.values + update_nodes),
        update_targets=tuple(timed.targets),
        update_entries=update_entries,
    )


class _Updates:
    """Nodes of what sets states anew at known times."""

    def __init__(self, graph: Graph, updates: Sequence[Update], symbols: Mapping[Any, int]) -> None:
        if len(updates) > MOST_UPDATES:
            raise ValueError(f"updates: expected at most {MOST_UPDATES}, given {len(updates)}")
        self._graph = graph
        pairs = [(q, symbols[state], value) for q, update in enumerate(updates) for state, value in update.values]
        self.targets = [(q, leaf - graph.leaves.x.start) for q, leaf, _ in pairs]
        self.values = nodes_of(graph, [value for _, _, value in pairs], symbols)

    def reads(self, leaf: int) -> int:
        """What a state depends on by its updates."""
        of = (i + self._graph.leaves.x.start for _, i in self.targets)
        return reduce(or_, (self._graph.reads[node] for at, node in zip(of, self.values, strict=True) if at == leaf), 0)


class _Resets:
    """Nodes of what sets states anew, and what states depend on because of it."""

    def __init__(self, graph: Graph, resets: Sequence[Reset], symbols: Mapping[Any, int], switching: Sequence[int]) -> None:
        if len(resets) > MOST_RESETS:
            raise ValueError(f"resets: expected at most {MOST_RESETS}, two for every latch, given {len(resets)}")
        self._graph, self._switching = graph, switching
        leaves = graph.leaves
        self.conditions = nodes_of(graph, [reset.condition for reset in resets], symbols)
        self.targets: list[tuple[int, int]] = []
        self.values: list[int] = []
        self._events: dict[int, int] = {}  # of every state that is set anew, what the times of that depend on
        for k, reset in enumerate(resets):
            event = _through_sides(graph, self.conditions[k], switching)
            for state, value in reset.values:
                (node,) = nodes_of(graph, [value], symbols)
                self.targets.append((k, symbols[state] - leaves.x.start))
                self.values.append(node)
                self._events[symbols[state]] = self._events.get(symbols[state], 0) | event
        self._values: dict[int, int] = {}
        for (_, i), node in zip(self.targets, self.values, strict=True):
            leaf = i + leaves.x.start
            self._values[leaf] = self._values.get(leaf, 0) | graph.reads[node]

    def read_through(self, state: int, rate: int) -> int:
        """What a state depends on by its own resets, and by those of states that its rate reads."""
        leaf = state + self._graph.leaves.x.start
        read = _through_sides(self._graph, rate, self._switching)
        events = (event for of, event in self._events.items() if of == leaf or read >> of & 1)
        moves = rate != self._graph.zero or not self._constant(leaf)
        return reduce(or_, events, self._values.get(leaf, 0)) if moves else 0

    def _constant(self, leaf: int) -> bool:
        """Whether all that a state is set to are numbers."""
        return not self._values.get(leaf, 0)

    def reads(self, leaf: int) -> int:
        """What moves a state where it is set anew."""
        return self._values.get(leaf, 0) | self._events.get(leaf, 0)


def _through_sides(graph: Graph, node: int, switching: Sequence[int]) -> int:
    """What a node reads, itself or by sides."""
    bits = graph.reads[node]
    sides = zip(graph.leaves.side, switching, strict=True)
    return reduce(or_, (graph.reads[surface] for side, surface in sides if graph.reads[node] >> side & 1), bits)


def _check(rates: Sequence[Any], surfaces: Surfaces, states: Sequence[Any], parameters: Sequence[Any]) -> None:
    values, sides, poles = surfaces.values, surfaces.sides, surfaces.poles
    if len(rates) != len(states):
        raise ValueError(f"rates: expected one for each of {len(states)} states, given {len(rates)}")
    if not len(sides) + poles <= len(values):
        raise ValueError(f"surfaces: expected at least {len(sides)} with sides and {poles} poles, given {len(values)}")
    for name, given, most in (("states", states, LIMIT), ("parameters", parameters, LIMIT), ("surfaces", sides, MOST_SURFACES)):
        if len(given) > most:
            raise ValueError(f"{name}: expected at most {most}, given {len(given)}")


def _by_value(graph: Graph, surfaces: Sequence[Any], sides: Sequence[Any], symbols: Mapping[Any, int]) -> list[int]:
    """Nodes of surfaces, in which sides are signs of values, and of limits, which read the sides where the trajectory runs."""
    known = {symbol: node for symbol, node in symbols.items() if symbol not in sides}
    waiting = dict(zip(sides, surfaces, strict=False))
    while waiting:
        ready = [side for side, surface in waiting.items() if not surface.free_symbols & waiting.keys()]
        if not ready:
            raise ValueError(f"surfaces: expected none that reads its own side, given {', '.join(map(str, waiting))}")
        for side in ready:
            known[side] = graph.call("sign", nodes_of(graph, [waiting.pop(side)], known)[0])
    return nodes_of(graph, surfaces[: len(sides)], known) + nodes_of(graph, surfaces[len(sides) :], symbols)


def _reads_any(graph: Graph, node: int, leaves: Sequence[int]) -> bool:
    return any(graph.reads[node] >> leaf & 1 for leaf in leaves)


def _reached(graph: Graph, rates: Sequence[int], switching: Sequence[int], anew: _Resets, switched: Sequence[int]) -> list[int]:
    """Leaves of the states that a parameter reaches: through rates, surfaces, by the time at which f switches, and inputs."""
    leaves = graph.leaves
    read_by = zip(leaves.x, rates, switched, strict=True)
    reads = [_through_sides(graph, node, switching) | anew.reads(leaf) | by for leaf, node, by in read_by]
    reached, before = (1 << len(leaves.theta)) - 1, -1
    while reached != before:
        before = reached
        for leaf, bits in zip(leaves.x, reads, strict=True):
            reached |= (1 << leaf) if bits & reached else 0
    return [leaf for leaf in leaves.x if reached >> leaf & 1]


def _read_through(graph: Graph, node: int, jumps: Sequence[int]) -> int:
    """What the jumps read whose sides a rate reads."""
    sides = zip(graph.leaves.side, jumps, strict=False)
    return reduce(or_, (graph.reads[jump] for side, jump in sides if graph.reads[node] >> side & 1), 0)


def _entries(
    graph: Graph, nodes: Sequence[int], variables: Sequence[int], besides: Sequence[int] | None = None
) -> tuple[Entries, list[int]]:
    """Places and nodes of derivatives; `besides` has the leaves of further ones, which are zero, for each node."""
    leaves = graph.leaves
    states: dict[tuple[int, int], int] = {}
    parameters: dict[tuple[int, int], int] = {}
    for i, row in enumerate(gradient(graph, nodes, variables)):
        further = {leaf: graph.zero for leaf in variables if besides and besides[i] >> leaf & 1}
        for leaf, node in (further | row).items():
            if leaf in leaves.x:
                states[i, leaf - leaves.x.start] = node
            else:
                parameters[i, leaf + leaves.states] = node
    found = sorted(states.items()) + sorted(parameters.items(), key=lambda item: item[0][::-1])
    return tuple(place for place, _ in found), [node for _, node in found]
