"""Kinds of everyday equations, each as a user may write it in several forms, and as modes without branches.

In all texts {w} is what drives the kind, and {dw} its rate; `random_kinds` draws them, and what follows the kind. Quantities are of
the order of one. In modes by sides S0 is the sign of the first height, and U0 is 1 above it and 0 below.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from automaton import Guard, Mode, by_sides

Range = tuple[float, float]


@dataclass(frozen=True)
class Kind:
    """One kind.

    Attributes
    ----------
    states, parameters : dict
        Ranges by name, of starts and values.
    forms : sequence of sequence of str
        Rates, in each of the ways of writing them.
    modes : dict
    x : str
        What others read of it.
    driven : bool
        Whether {w} is in it.
    resets : dict
        As of `fp.SymbolicModel`.
    outputs : sequence of str
        By default its states.
    meets : dict
        States, and where one may start on a surface: a number or a name.
    memory : bool
        As of `Automaton`.
    positive : bool
        Whether {w} has to be positive.
    beside_roots : bool
        Whether it takes the root of what becomes zero.
    """

    states: Mapping[str, Range]
    parameters: Mapping[str, Range]
    forms: Sequence[Sequence[str]]
    modes: Mapping[str, Mode]
    x: str
    driven: bool = True
    resets: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    outputs: Sequence[str] = ()
    meets: Mapping[str, float | str] = field(default_factory=dict)
    memory: bool = False
    positive: bool = False
    beside_roots: bool = False


def orifice() -> Kind:
    """A pressure p that is driven, and a volume at q behind an orifice."""
    flows = (
        "k*sign(p - q)*sqrt(abs(p - q))",
        "k*(sqrt(max(p - q, 0)) - sqrt(max(q - p, 0)))",
        "where(p > q, k*sqrt(p - q), -k*sqrt(q - p))",
        "k*sign(p - q)*abs(p - q)**0.5",
    )
    return Kind(
        {"p": (-1, 1), "q": (-1, 1)},
        {"k": (0.3, 1.5), "d": (0.3, 1.5)},
        [("{w} - d*p", flow) for flow in flows],
        by_sides(["{w} - d*p", "k*S0*sqrt(abs(p - q))"], ["p - q"]),
        "q",
        meets={"p": "q"},
        beside_roots=True,
    )


def relief_valve() -> Kind:
    flows = ("k*sqrt(max(p - ps, 0))", "where(p > ps, k*sqrt(p - ps), 0)", "where(p <= ps, 0, k*sqrt(abs(p - ps)))")
    return Kind(
        {"p": (0, 1.5)},
        {"k": (0.3, 1.5), "ps": (0.4, 1), "d": (0.1, 0.5)},
        [(f"0.7 + {{w}} - d*p - {flow}",) for flow in flows],
        by_sides(["0.7 + {w} - d*p - k*U0*sqrt(abs(p - ps))"], ["p - ps"]),
        "p",
        beside_roots=True,
    )


def weir() -> Kind:
    flows = ("where(h > hm, k*(h - hm)**1.5, 0)", "k*max(h - hm, 0)**1.5")
    return Kind(
        {"h": (0, 1.5)},
        {"k": (0.5, 2), "hm": (0.4, 1), "d": (0.1, 0.5)},
        [(f"0.5 + {{w}} - d*h - {flow}",) for flow in flows],
        by_sides(["0.5 + {w} - d*h - k*U0*abs(h - hm)**1.5"], ["h - hm"]),
        "h",
        beside_roots=True,
    )


FALLS = ("k*sqrt(max(h, 0))", "where(h > 0, k*sqrt(h), 0)", "where(h > 0, k*sqrt(max(h, 0)), 0)")


def tank_runs_dry() -> Kind:
    wet, dry = Mode(["-k/2", "k*h"], [Guard("h", "dry")], ["h"]), Mode(["0.0", "0.0"])
    return Kind(
        {"h": (0, 1.5), "V": (0, 1)},
        {"k": (0.4, 2)},
        [(f"-{fall}", fall) for fall in FALLS],
        {"wet": wet, "dry": dry},
        "V",
        driven=False,
        meets={"h": 0.0},
        memory=True,
        beside_roots=True,
    )


def tank_filled_again() -> Kind:
    """It is filled from t1 to t2, runs dry before and after."""
    on, off = Guard("t1 - clock", "filled"), Guard("t2 - clock", "left")
    modes = {
        "at first": Mode(["1", "-k/2"], [Guard("h", "dry"), on], ["h"]),
        "dry": Mode(["1", "0.0"], [on]),
        "filled": Mode(["1", "a - k*sqrt(abs(h))"], [off, Guard("clock - t1 + 1e-9")]),
        "left": Mode(["1", "-k/2"], [Guard("h", "empty"), Guard("clock - t2 + 1e-9")], ["h"]),
        "empty": Mode(["1", "0.0"]),
    }
    return Kind(
        {"clock": (0, 0.5), "h": (0, 0.6)},
        {"k": (0.8, 2), "a": (0.4, 1.2), "t1": (0.7, 1.5), "t2": (1.7, 2.5)},
        [("1", f"-{fall} + where((clock > t1) and (clock < t2), a, 0)") for fall in FALLS],
        modes,
        "h",
        driven=False,
        meets={"h": 0.0},
        memory=True,
        beside_roots=True,
    )


def cylinder() -> Kind:
    """A four-edge spool at {w} between a supply of 1 and a tank at pt, and a piston."""

    def root(text: str) -> str:
        return f"sign({text})*sqrt(abs({text}))"

    QA = f"B*(max({{w}}, 0)*{root('1 - pA')} - max(-({{w}}), 0)*{root('pA - pt')})"
    QB = f"B*(max({{w}}, 0)*{root('pB - pt')} - max(-({{w}}), 0)*{root('1 - pB')})"
    where_A = f"B*({{w}})*where({{w}} > 0, {root('1 - pA')}, {root('pA - pt')})"
    where_B = f"B*({{w}})*where({{w}} > 0, {root('pB - pt')}, {root('1 - pB')})"
    A = "B*({w})*(U0*S1*sqrt(abs(1 - pA)) + (1 - U0)*S2*sqrt(abs(pA - pt)))"
    B = "B*({w})*(U0*S4*sqrt(abs(pB - pt)) + (1 - U0)*S3*sqrt(abs(1 - pB)))"
    return Kind(
        {"v": (-0.5, 0.5), "pA": (0, 1.1), "pB": (0, 1.1)},
        {"B": (1, 3), "pt": (0.03, 0.1), "b": (0.3, 1), "E": (3, 8)},
        [("4*(pA - pB) - b*v", f"E*({a} - v)", f"E*(v - {b})") for a, b in ((QA, QB), (where_A, where_B))],
        by_sides(["4*(pA - pB) - b*v", f"E*({A} - v)", f"E*(v - {B})"], ["{w}", "1 - pA", "pA - pt", "1 - pB", "pB - pt"]),
        "v",
        meets={"pA": 1.0, "pB": 1.0},
        beside_roots=True,
    )


ZONES = (
    "(max(v - l, 0) + min(v + l, 0))",
    "sign(v)*max(abs(v) - l, 0)",
    "where(abs(v) > l, v - l*sign(v), 0)",
    "where(v > l, v - l, where(v < -l, v + l, 0))",
)


def dead_zone() -> Kind:
    return Kind(
        {"v": (-1, 1), "y": (-1, 1)},
        {"l": (0.1, 0.8), "k": (0.5, 2), "T": (0.1, 1)},
        [("({w} - v)/T", f"k*{zone} - y") for zone in ZONES],
        by_sides(["({w} - v)/T", "k*(U0*(v - l) + (1 - U1)*(v + l)) - y"], ["v - l", "v + l"]),
        "y",
        meets={"v": 0.0},
    )


def lap() -> Kind:
    """A valve with two laps, that fills and empties a volume."""
    root = "sign({0})*sqrt(abs({0}))"
    up, down = root.format("1 - p"), root.format("p - 0.1")
    forms = (
        f"k*(max(v - l, 0)*{up} - max(-v - m, 0)*{down})",
        f"k*where(v > l, (v - l)*{up}, where(v < -m, (v + m)*{down}, 0))",
    )
    side = "k*(U0*(v - l)*S2*sqrt(abs(1 - p)) + (1 - U1)*(v + m)*S3*sqrt(abs(p - 0.1)))"
    return Kind(
        {"v": (-1, 1), "p": (0.2, 0.9)},
        {"l": (0.05, 0.3), "m": (0.05, 0.3), "k": (0.5, 2), "T": (0.1, 1)},
        [("({w} - v)/T", f"{form} - 0.2*(p - 0.5)") for form in forms],
        by_sides(["({w} - v)/T", f"{side} - 0.2*(p - 0.5)"], ["v - l", "v + m", "1 - p", "p - 0.1"]),
        "p",
        meets={"v": 0.0},
        beside_roots=True,
    )


def clamped_integrator() -> Kind:
    """A controller of y whose integrator stops while the actuator is at its limit, and slides along it."""
    e, raw = "({w} - y)", "(kp*({w} - y) + i)"
    clamps = (
        f"where(abs({raw}) < um or {e}*{raw} < 0, ki*{e}, 0)",
        f"where(({raw} > um and {e} > 0) or ({raw} < -um and {e} < 0), 0, ki*{e})",
        f"where({raw} > um, where({e} > 0, 0, ki*{e}), where({raw} < -um, where({e} < 0, 0, ki*{e}), ki*{e}))",
    )
    modes = {"free": Mode([f"({raw} - y)/T", f"ki*{e}"], [Guard(f"um - {raw}"), Guard(f"um + {raw}")])}
    for name, s in (("high", "(1)"), ("low", "(-1)")):
        y, past = f"({s}*um - y)/T", Guard(f"{s}*{raw} - um")
        slide = f"kp*({y} - ({{dw}}))"
        modes[name] = Mode([y, "0.0"], [past, Guard(f"{s}*{e}")])
        modes[f"{name}, back"] = Mode([y, f"ki*{e}"], [past, Guard(f"-{s}*{e}")])
        ends = [Guard(f"{s}*{slide}", name), Guard(f"{s}*(ki*{e} - {slide})", "free")]
        modes[f"{name}, along"] = Mode([y, slide], [*ends, Guard(f"1e-7 - abs({s}*{raw} - um)")])
    return Kind(
        {"y": (-1, 1), "i": (-0.3, 0.3)},
        {"kp": (0.5, 3), "ki": (0.5, 2), "um": (0.5, 1.2), "T": (0.5, 2)},
        [(f"(max(min({raw}, um), -um) - y)/T", clamp) for clamp in clamps],
        modes,
        "y",
        meets={"i": 0.0},
    )


def infusions() -> Kind:
    """Two of them, which may follow one another back to back."""
    second = ("where((clock >= s) and (clock < s + T2), R2, 0)", "R2*(heaviside(clock - s) - heaviside(clock - s - T2))")
    return Kind(
        {"clock": (0, 0.3), "c": (0, 1)},
        {"T1": (0.4, 1.5), "R1": (0.3, 2), "s": (0.4, 2), "T2": (0.3, 1), "R2": (0.3, 2), "k": (0.2, 1)},
        [("1", f"where(clock < T1, R1, 0) + {two} - k*c") for two in second],
        by_sides(["1", "U0*R1 + U1*U2*R2 - k*c"], ["T1 - clock", "clock - s", "s + T2 - clock"]),
        "c",
        driven=False,
        meets={"clock": 0.0},
    )


def log_of_nothing() -> Kind:
    """What is taken up from a depot, measured by its logarithm."""
    return Kind(
        {"a": (0.3, 2), "c": (0, 0)},
        {"ka": (0.5, 3), "ke": (0.2, 1)},
        [("-ka*a", "ka*a - ke*c")],
        {"": Mode(["-ka*a", "ka*a - ke*c"])},
        "c",
        driven=False,
        outputs=("log(c)", "sqrt(c)"),
    )


def relay() -> Kind:
    return Kind(
        {"T": (0, 1.5)},
        {"k": (0.3, 1), "P": (1.5, 3), "lo": (0.4, 0.7), "hi": (0.9, 1.2)},
        [("k*(0.3*({w}) - T) + where(latch(T < lo, T > hi), P, 0)",), ("k*(0.3*({w}) - T) + P*latch(lo > T, T - hi > 0)",)],
        {
            "off": Mode(["k*(0.3*({w}) - T)"], [Guard("T - lo", "on")]),
            "on": Mode(["k*(0.3*({w}) - T) + P"], [Guard("hi - T", "off")]),
        },
        "T",
        memory=True,
    )


def bouncing_mass() -> Kind:
    rates = ["v", "{w} - g - d*v*abs(v)"]
    return Kind(
        {"y": (0.3, 1.5), "v": (-1, 1)},
        {"g": (2, 4), "e": (0.6, 0.95), "d": (0.05, 0.3), "floor": (-0.1, 0.2)},
        [rates],
        {"": Mode(rates, [Guard("y - floor", "", {"v": "-e*v"})])},
        "y",
        resets={"y < floor": {"v": "-e*v"}},
        meets={"v": 0.0},
    )


def stroke() -> Kind:
    """A mass between two stops."""
    rates = ["v", "3*({w}) - b*v"]
    return Kind(
        {"y": (0.1, 0.8), "v": (-1, 1)},
        {"b": (0.1, 1), "e": (0.3, 0.9), "L": (0.9, 1.2)},
        [rates],
        {"": Mode(rates, [Guard("y", "", {"v": "-e*v"}), Guard("L - y", "", {"v": "-e*v"})])},
        "y",
        resets={"y < 0": {"v": "-e*v"}, "y > L": {"v": "-e*v"}},
        meets={"v": 0.0},
    )


def doses() -> Kind:
    """Two doses that are given at once, at estimated times."""
    rates = ["1", "-k*c"]
    first, second = Guard("t1 - clock", "two", {"c": "c + D"}), Guard("t2 - clock", "three", {"c": "c + D"})
    modes = {"one": Mode(rates, [first]), "two": Mode(rates, [second]), "three": Mode(rates)}
    return Kind(
        {"clock": (0, 0.3), "c": (0, 1)},
        {"k": (0.3, 1.5), "D": (0.3, 1), "t1": (0.4, 1), "t2": (1.1, 2)},
        [rates],
        modes,
        "c",
        driven=False,
        resets={"clock > t1": {"c": "c + D"}, "clock > t2": {"c": "c + D"}},
        memory=True,
    )


def power() -> Kind:
    flows = ("k*max(h, 0)**b", "where(h > 0, k*h**b, 0)")
    return Kind(
        {"h": (-0.5, 1)},
        {"k": (0.5, 2), "b": (0.5, 2.5), "d": (0.1, 0.5)},
        [(f"{{w}} - d*h - {flow}",) for flow in flows],
        by_sides(["{w} - d*h - k*U0*abs(h)**b"], ["h"]),
        "h",
        meets={"h": 0.0},
        beside_roots=True,
    )


def power_from_zero() -> Kind:
    flow = "V*h**b/(K + h**b)"
    return Kind(
        {"h": (0, 0)},
        {"V": (0.3, 0.6), "K": (0.3, 1), "b": (0.5, 3)},
        [(f"{{w}} - {flow} - 0.2*h",)],
        {"": Mode(["{w} - V*abs(h)**b/(K + abs(h)**b) - 0.2*h"])},
        "h",
        positive=True,
        beside_roots=True,
    )


def frictions() -> Kind:
    """Two masses with a spring between them and dry friction on each."""
    forces = {"v": "2*({w}) - k*(y - z) - 0.2*v", "w2": "k*(y - z) - 0.2*w2"}
    sides = (("sign(v)", "sign(w2)"), ("(2*heaviside(v) - 1)", "where(w2 > 0, 1, -1)"))
    modes = {}
    for each in itertools.product("+-0", repeat=2):
        rates, guards = ["v", "w2"], []
        for n, ((name, force), side) in enumerate(zip(forces.items(), each, strict=True)):

            def other(new: str, n: int = n, each: tuple[str, ...] = each) -> str:
                return "".join(new if m == n else side for m, side in enumerate(each))

            c = f"c{n + 1}"
            if side == "0":
                rates.append("0.0")
                guards += [
                    Guard(f"{c} - ({force})", other("+")),
                    Guard(f"{c} + ({force})", other("-")),
                    Guard(f"1e-9 - abs({name})"),
                ]
            else:
                rates.append(f"{force} - ({side}{c})")
                guards.append(Guard(f"{side}{name}"))
        modes["".join(each)] = Mode(rates, guards)
    return Kind(
        {"y": (-0.5, 0.5), "z": (-0.5, 0.5), "v": (-1, 1), "w2": (-1, 1)},
        {"k": (1, 4), "c1": (0.2, 1), "c2": (0.1, 0.6)},
        [["v", "w2", f"{forces['v']} - c1*{a}", f"{forces['w2']} - c2*{b}"] for a, b in sides],
        modes,
        "z",
        meets={"v": 0.0, "w2": 0.0},
    )


KINDS = {
    of.__name__.replace("_", " "): of
    for of in (
        orifice,
        relief_valve,
        weir,
        tank_runs_dry,
        tank_filled_again,
        cylinder,
        dead_zone,
        lap,
        clamped_integrator,
        infusions,
        log_of_nothing,
        relay,
        bouncing_mass,
        stroke,
        doses,
        power,
        power_from_zero,
        frictions,
    )
}
