"""The arguments on which a force of unknown form may depend, with one effect function each.

Every function has p = (factor, address of a curve), and adds the factor times the curve of its argument.
"""

from dataclasses import dataclass

import numpy as np

from analysis.collision.effects.kernel import Kernel
from analysis.collision.effects.row import Effect, Parameter
from analysis.collision.laws.curve import Curve
from analysis.collision.laws.formula import STATE, Formula, kernel_of
from analysis.collision.laws.user_law import PLACES
from analysis.collision.parameters import Collision, Floats


@dataclass(frozen=True, slots=True)
class Argument:
    """The argument of a force that acts on the block, on the plate, or between them while they touch (``where``).

    ``expression`` is the argument in a formula, ``factor`` the factor of the curve there ("": none).  ``gauge`` lists
    the curves that the base model already includes ("1": constant, "x": linear), and ``unseen`` describes them in
    words.
    """

    where: str
    name: str
    unit: str
    expression: str
    factor: str = ""
    gauge: tuple[str, ...] = ()
    unseen: str = ""  # the part of the law that no shot can show, in words

    @property
    def touching(self) -> bool:
        """Get whether the force acts only in contact."""
        return self.where == "contact"

    @property
    def kernel(self) -> Kernel:
        """Get the effect's function."""
        text = f"factor*curve(table, {self.expression})" + (f"*{self.factor}" if self.factor else "")
        return kernel_of(Formula(text, ("factor", "table"), ()), PLACES[self.where][1], self.touching)

    def value(self, inputs: Floats) -> Floats:
        """Return the argument, shape (n,), from the inputs of an effect's function, shape (n, STATES)."""
        state = {name: inputs[:, column] for name, column in STATE.items()}
        return np.asarray(Formula(self.expression, (), ()).values(state, {}))

    def row(self, curve: Curve) -> Effect:
        """Return the force with this curve as a catalogue row; the caller must keep the curve alive."""
        return Effect(
            f"law_{self.where}_{self.name}".replace(" ", "_"),
            f"a force as a function of {self.name}",
            PLACES[self.where][0],
            (Parameter("factor", "", 1.0, fixed=True), Parameter("table", "", curve.address, fixed=True)),
            "factor",
            self.kernel,
            rough=self.touching,
            kinked=self.factor == "sign(u)",  # the plate's turn is not an event
            fastest=lambda _values, collision: self._rate(curve, collision),
        )

    def _rate(self, curve: Curve, c: Collision) -> float:
        mass = c.block_mass_kg if self.where == "block" else min(c.block_mass_kg, c.plate_mass_kg)
        slope = curve.largest_slope / mass
        return slope if self.unit == "m/s" else float(np.sqrt(slope))  # of a force that grows with a speed: a rate


ARGUMENTS: tuple[Argument, ...] = (
    Argument(
        "block", "place", "m", "x",
        unseen="in contact its linear part is k_p and its constant part a shift of the rest position",
    ),
    Argument("block", "speed against the motion", "m/s", "abs(v)", "sign(v)"),
    Argument("block", "speed one way", "m/s", "abs(v)"),
    Argument("block", "place times speed", "m", "x", "v"),
    Argument("plate", "bend", "m", "y", gauge=("x",), unseen="its linear part is k_p"),
    Argument("plate", "plate speed", "m/s", "u"),
    Argument("plate", "bend against motion", "m", "y", "sign(u)"),
    Argument("plate", "bend times rate", "m", "y", "u"),
    Argument("contact", "overlap", "m", "d", gauge=("x",), unseen="its linear part is k_N"),
    Argument("contact", "overlap rate", "m/s", "d_rate", gauge=("x",), unseen="its linear part is gamma_N"),
    Argument("contact", "overlap times rate", "m", "d", "d_rate", ("1",), "its constant part is gamma_N"),
)  # fmt: skip
