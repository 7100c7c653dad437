"""Closed forms for a learned curve: each is a formula of its argument, with starting values of its parameters.

The same formula text is used to fit the curve and to fit the shots.  A form is linear in ``a``, its size.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.collision.laws.arguments import Argument
from analysis.collision.laws.formula import STATE, Formula, read
from analysis.collision.laws.user_law import UserLaw, law_from_table
from analysis.collision.parameters import Floats


@dataclass(frozen=True, slots=True)
class Form:
    """A closed form: ``text`` with {z} for the argument.

    ``lengths`` are parameters in the argument's unit, ``positive`` those that must exceed 0; ``powers`` have no unit.
    """

    name: str
    text: str
    lengths: tuple[str, ...] = ()
    positive: tuple[str, ...] = ()
    powers: tuple[str, ...] = ()
    argument_power: int | str = 0  # power of the argument that ``a`` multiplies: a number, or a parameter's name

    @property
    def nonlinear_parameters(self) -> tuple[str, ...]:
        """Get the names of the parameters in which the form is not linear."""
        return (*self.lengths, *self.powers)

    def formula(self, argument: Argument) -> Formula:
        """Return the force as a formula of the state."""
        inner = self.text.format(z=argument.expression)
        whole = f"({inner})*{argument.factor}" if argument.factor else inner
        return read(whole, ("a", *self.nonlinear_parameters))

    def values(self, z: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the curve at arguments ``z``, any shape, in N."""
        text = self.text.format(z="x")
        state = {name: z if name == "x" else 0.0 for name in STATE}
        return np.asarray(Formula(text, ("a", *self.nonlinear_parameters), ()).values(state, parameters)) + 0.0 * z

    def starts(self, low: float, high: float) -> list[dict[str, float]]:
        """Return starting values of the nonlinear parameters for an argument in [low, high].

        Starting values of an offset are spaced by the width, because a search cannot find a bump that it does not
        overlap.
        """
        span = max(abs(low), abs(high))
        out: list[dict[str, float]] = [{}]
        for name in self.nonlinear_parameters:
            if name in self.positive:
                out = [one | {name: span * f} for one in out for f in (0.02, 0.07, 0.2, 0.6, 2.0)]
            elif name in self.powers:
                out = [one | {name: value} for one in out for value in (0.5, 1.5, 2.5, 4.0)]
            else:
                out = [one | {name: value} for one in out for value in self._shifts(low, high, one)]
        return out

    def _shifts(self, low: float, high: float, widths: Mapping[str, float]) -> list[float]:
        count = 5 if not widths else max(5, min(50, math.ceil((high - low) / min(widths.values()))))
        return [low + (high - low) * (k + 0.5) / count for k in range(count)]

    def law(self, argument: Argument, parameters: Mapping[str, float], span: float) -> UserLaw:
        """Return the form as a law for the exact solver, with these parameter values as its start."""
        table = {}
        for name in ("a", *self.nonlinear_parameters):
            entry: dict[str, object] = {"unit": self._unit(name, argument), "start": float(parameters[name]) or 1e-12}
            if name in self.positive:
                entry |= {"lower": 1e-5 * span, "upper": 1e3 * span}
                entry["start"] = float(np.clip(parameters[name], 2e-5 * span, 5e2 * span))
            elif name in self.powers:
                entry |= {"lower": 0.05, "upper": 12.0}
                entry["start"] = float(np.clip(parameters[name], 0.1, 11.0))
            table[name] = entry
        text = self.formula(argument).text
        name = "law_" + self.name.replace(" ", "_").replace(",", "").replace("-", "_")
        words = (
            "a force while they touch"
            if self.name == "constant"
            else f"a force as a function of {argument.name}, {self.name}"
        )
        return law_from_table(
            {"name": name, "words": words, "where": argument.where, "formula": text, "parameters": table}
        )

    def _unit(self, name: str, argument: Argument) -> str:
        if name != "a":
            return argument.unit if name in self.lengths else ""
        if isinstance(self.argument_power, str):
            return f"N per (argument)^{self.argument_power}"
        of_factor = " s/m" if argument.factor in ("v", "u", "d_rate") else ""
        if self.argument_power == 0:
            return f"N{of_factor}"
        power = ("", "", "²", "³")[self.argument_power]
        by_argument = {"m": f"/m{power}", "m/s": f" s{power}/m{power}"}[argument.unit]
        return f"N{by_argument}{of_factor}"


FORMS: tuple[Form, ...] = (
    Form("constant", "a"),
    Form("linear", "a*{z}", argument_power=1),
    Form("quadratic", "a*{z}**2", argument_power=2),
    Form("quadratic, odd", "a*{z}*abs({z})", argument_power=2),
    Form("cubic", "a*{z}**3", argument_power=3),
    Form("power", "a*abs({z})**n", powers=("n",), argument_power="n"),
    Form("power, odd", "a*sign({z})*abs({z})**n", powers=("n",), argument_power="n"),
    Form("exponential", "a*exp(-abs({z})/b)", ("b",), ("b",)),
    Form("rising exponential", "a*exp({z}/b)", ("b",), ("b",)),
    Form("falling exponential", "a*exp(-{z}/b)", ("b",), ("b",)),
    Form("inverse", "a/(1 + abs({z})/b)", ("b",), ("b",)),
    Form("inverse square", "a/(1 + abs({z})/b)**2", ("b",), ("b",)),
    Form("inverse power", "a/(1 + abs({z})/b)**n", ("b",), ("b",), ("n",)),
    Form("Yukawa", "a*exp(-abs({z})/b)/(1 + abs({z})/c)", ("b", "c"), ("b", "c")),
    Form("Gaussian", "a*exp(-({z}/b)**2)", ("b",), ("b",)),
    Form("Gaussian off zero", "a*exp(-(({z} - c)/b)**2)", ("b", "c"), ("b",)),
    Form("Lorentzian", "a/(1 + ({z}/b)**2)", ("b",), ("b",)),
    Form("Lorentzian off zero", "a/(1 + (({z} - c)/b)**2)", ("b", "c"), ("b",)),
    Form("tanh", "a*tanh({z}/b)", ("b",), ("b",)),
    Form("saturating", "a*{z}/(abs({z}) + b)", ("b",), ("b",)),
    Form("sine", "a*sin({z}/b + c)", ("b",), ("b",), ("c",)),
    Form("hinge", "a*max(0, {z} - c)", ("c",), argument_power=1),
    Form("hinge below", "a*max(0, c - {z})", ("c",), argument_power=1),
)
