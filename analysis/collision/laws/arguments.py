"""The arguments on which a force of unknown form may depend, with one effect function each.

Every function has p = (factor, address of a curve), and adds the factor times the curve of its argument.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.collision.effects.kernel import (
    ON_BLOCK,
    ON_PLATE,
    PAIR,
    SIGN_V,
    TOUCHING,
    XI,
    XI_RATE,
    Kernel,
    U,
    V,
    X,
    Y,
)
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.laws.curve import Curve, curve_at
from analysis.collision.parameters import Collision, Floats

Inputs = Floats  # of an effect's function, shape (n, STATES)


def of_place(s: Any, p: Any, out: Any) -> None:
    """Add F(x) to the block."""
    out[ON_BLOCK] += p[0] * curve_at(p[1], s[X])


def of_speed_against(s: Any, p: Any, out: Any) -> None:
    """Add F(|v|) sgn v to the block."""
    out[ON_BLOCK] += p[0] * curve_at(p[1], s[V] * s[SIGN_V].real) * s[SIGN_V].real


def of_speed_one_way(s: Any, p: Any, out: Any) -> None:
    """Add F(|v|) to the block, with the same sign on the way in and on the way out."""
    out[ON_BLOCK] += p[0] * curve_at(p[1], s[V] * s[SIGN_V].real)


def of_place_times_speed(s: Any, p: Any, out: Any) -> None:
    """Add F(x) v to the block."""
    out[ON_BLOCK] += p[0] * curve_at(p[1], s[X]) * s[V]


def of_bend(s: Any, p: Any, out: Any) -> None:
    """Add F(y) to the plate."""
    out[ON_PLATE] += p[0] * curve_at(p[1], s[Y])


def of_plate_speed(s: Any, p: Any, out: Any) -> None:
    """Add F(u) to the plate."""
    out[ON_PLATE] += p[0] * curve_at(p[1], s[U])


def of_bend_against(s: Any, p: Any, out: Any) -> None:
    """Add F(y) sgn u to the plate."""
    way = 1.0 if s[U].real > 0.0 else -1.0
    out[ON_PLATE] += p[0] * curve_at(p[1], s[Y]) * way


def of_bend_times_rate(s: Any, p: Any, out: Any) -> None:
    """Add F(y) u to the plate."""
    out[ON_PLATE] += p[0] * curve_at(p[1], s[Y]) * s[U]


def of_overlap(s: Any, p: Any, out: Any) -> None:
    """Add F(d) between block and plate while they touch."""
    if s[TOUCHING].real > 0.5:
        out[PAIR] += p[0] * curve_at(p[1], s[XI])


def of_overlap_rate(s: Any, p: Any, out: Any) -> None:
    """Add F(d') between block and plate while they touch."""
    if s[TOUCHING].real > 0.5:
        out[PAIR] += p[0] * curve_at(p[1], s[XI_RATE])


def of_overlap_times_rate(s: Any, p: Any, out: Any) -> None:
    """Add F(d) d' between block and plate while they touch."""
    if s[TOUCHING].real > 0.5:
        out[PAIR] += p[0] * curve_at(p[1], s[XI]) * s[XI_RATE]


@dataclass(frozen=True, slots=True)
class Argument:
    """The argument of a force: ``value`` computes it from the inputs of an effect's function.

    ``expression`` is the argument in a formula, ``factor`` the factor of the curve there ("": none).  ``touching``: the
    force acts only in contact.  ``gauge`` lists the curves that the base model already includes ("1": constant, "x":
    linear), and ``unseen`` describes them in words.
    """

    where: str
    name: str
    unit: str
    expression: str
    factor: str
    kernel: Kernel
    acts: Acts
    value: Callable[[Inputs], Floats]
    touching: bool = False
    gauge: tuple[str, ...] = ()
    unseen: str = ""  # the part of the law that no shot can show, in words
    slow: bool = False  # the argument is a speed: slope of the curve over mass is a rate, not a rate squared

    def row(self, curve: Curve) -> Effect:
        """Return the force with this curve as a catalogue row; the caller must keep the curve alive."""
        return Effect(
            f"law_{self.where}_{self.name}".replace(" ", "_"),
            f"a force as a function of {self.name}",
            self.acts,
            (Parameter("factor", "", 1.0, fixed=True), Parameter("table", "", curve.address, fixed=True)),
            "factor",
            self.kernel,
            rough=self.touching,
            kinked=self.factor == "sign(u)",  # the plate's turn is not an event
            fastest=lambda _values, collision: self._rate(curve, collision),
        )

    def _rate(self, curve: Curve, c: Collision) -> float:
        mass = c.block_mass_kg if self.acts is Acts.ON_BLOCK else min(c.block_mass_kg, c.plate_mass_kg)
        slope = curve.largest_slope / mass
        return slope if self.slow else float(np.sqrt(slope))


ARGUMENTS: tuple[Argument, ...] = (
    Argument(
        "block", "place", "m", "x", "", of_place, Acts.ON_BLOCK, lambda s: s[:, X],
        unseen="in contact its linear part is k_p and its constant part a shift of the rest position",
    ),
    Argument(
        "block", "speed against the motion", "m/s", "abs(v)", "sign(v)", of_speed_against, Acts.ON_BLOCK,
        lambda s: np.abs(s[:, V]), slow=True,
    ),
    Argument(
        "block", "speed one way", "m/s", "abs(v)", "", of_speed_one_way, Acts.ON_BLOCK,
        lambda s: np.abs(s[:, V]), slow=True,
    ),
    Argument("block", "place times speed", "m", "x", "v", of_place_times_speed, Acts.ON_BLOCK, lambda s: s[:, X]),
    Argument(
        "plate", "bend", "m", "y", "", of_bend, Acts.ON_PLATE, lambda s: s[:, Y], gauge=("x",),
        unseen="its linear part is k_p",
    ),
    Argument("plate", "plate speed", "m/s", "u", "", of_plate_speed, Acts.ON_PLATE, lambda s: s[:, U], slow=True),
    Argument("plate", "bend against motion", "m", "y", "sign(u)", of_bend_against, Acts.ON_PLATE, lambda s: s[:, Y]),
    Argument("plate", "bend times rate", "m", "y", "u", of_bend_times_rate, Acts.ON_PLATE, lambda s: s[:, Y]),
    Argument(
        "contact", "overlap", "m", "d", "", of_overlap, Acts.IN_CONTACT, lambda s: s[:, XI],
        touching=True, gauge=("x",), unseen="its linear part is k_N",
    ),
    Argument(
        "contact", "overlap rate", "m/s", "d_rate", "", of_overlap_rate, Acts.IN_CONTACT, lambda s: s[:, XI_RATE],
        touching=True, gauge=("x",), unseen="its linear part is gamma_N", slow=True,
    ),
    Argument(
        "contact", "overlap times rate", "m", "d", "d_rate", of_overlap_times_rate, Acts.IN_CONTACT,
        lambda s: s[:, XI], touching=True, gauge=("1",), unseen="its constant part is gamma_N",
    ),
)  # fmt: skip
