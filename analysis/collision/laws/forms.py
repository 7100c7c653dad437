"""Closed forms that a learned curve may be: each a formula of its argument, and where a search of it begins.

A form is written once, as the text of a formula; what is fitted to the curve and what is fitted to the shots are that
same text.  ``a`` is always the size, in which a form is linear.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.collision.laws.arguments import Argument
from analysis.collision.laws.formula import STATE, Formula, read
from analysis.collision.laws.own import OwnLaw, from_mapping

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Form:
    """A closed form: ``text`` in which {z} stands for the argument; ``lengths`` are parameters in its unit, of size
    and sign as the range allows, ``positive`` those that are above 0, ``powers`` numbers without unit."""

    name: str
    text: str
    lengths: tuple[str, ...] = ()
    positive: tuple[str, ...] = ()
    powers: tuple[str, ...] = ()
    even: bool = False  # the same on both sides of zero: without news where the argument has one sign
    odd: bool = False

    @property
    def bent(self) -> tuple[str, ...]:
        """Get the parameters in which the form is not linear."""
        return (*self.lengths, *self.powers)

    def formula(self, argument: Argument) -> Formula:
        """Return the force as a formula of the named state."""
        inner = self.text.format(z=argument.expression)
        whole = f"({inner})*{argument.factor}" if argument.factor else inner
        return read(whole, ("a", *self.bent))

    def values(self, z: Floats, parameters: Mapping[str, float]) -> Floats:
        """Return the curve at arguments ``z``, any shape, in N."""
        text = self.text.format(z="x")
        state = {name: z if name == "x" else 0.0 for name in STATE}
        return np.asarray(Formula(text, ("a", *self.bent), ()).values(state, parameters)) + 0.0 * z

    def starts(self, low: float, high: float) -> list[dict[str, float]]:
        """Return where the bent parameters may begin for an argument in [low, high].

        A place off zero begins everywhere, as close as the form is wide: a search from beside a bump never meets it.
        """
        span = max(abs(low), abs(high))
        out: list[dict[str, float]] = [{}]
        for name in self.bent:
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

    def law(self, argument: Argument, parameters: Mapping[str, float], span: float) -> OwnLaw:
        """Return the form with these values as a law that the exact solver takes."""
        table = {}
        for name in ("a", *self.bent):
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
            "a force while they touch" if self.name == "constant" else f"a force of the {argument.name}, {self.name}"
        )
        return from_mapping(
            {"name": name, "words": words, "where": argument.where, "formula": text, "parameters": table}
        )

    def _unit(self, name: str, argument: Argument) -> str:
        if name == "a":
            power = _POWER.get(self.name, 0)
            extra = {"v": " s/m", "u": " s/m", "d_rate": " s/m"}.get(argument.factor, "")
            if self.powers and "{z}**n" in self.text.replace("abs({z})", "{z}"):
                return "N per (argument)^n"
            unit = {"m": "/m", "m/s": " s/m"}[argument.unit] if power else ""
            return f"N{unit}{'' if power < 2 else power}{extra}" if power else f"N{extra}"
        return argument.unit if name in self.lengths else ""


_POWER = {"linear": 1, "quadratic": 2, "cubic": 3, "quadratic, odd": 2, "hinge": 1, "hinge below": 1}

FORMS: tuple[Form, ...] = (
    Form("constant", "a"),
    Form("linear", "a*{z}", odd=True),
    Form("quadratic", "a*{z}**2", even=True),
    Form("quadratic, odd", "a*{z}*abs({z})", odd=True),
    Form("cubic", "a*{z}**3", odd=True),
    Form("power", "a*abs({z})**n", powers=("n",), even=True),
    Form("power, odd", "a*sign({z})*abs({z})**n", powers=("n",), odd=True),
    Form("exponential", "a*exp(-abs({z})/b)", ("b",), ("b",), even=True),
    Form("rising exponential", "a*exp({z}/b)", ("b",), ("b",)),
    Form("falling exponential", "a*exp(-{z}/b)", ("b",), ("b",)),
    Form("inverse", "a/(1 + abs({z})/b)", ("b",), ("b",), even=True),
    Form("inverse square", "a/(1 + abs({z})/b)**2", ("b",), ("b",), even=True),
    Form("inverse power", "a/(1 + abs({z})/b)**n", ("b",), ("b",), ("n",), even=True),
    Form("Yukawa", "a*exp(-abs({z})/b)/(1 + abs({z})/c)", ("b", "c"), ("b", "c"), even=True),
    Form("Gaussian", "a*exp(-({z}/b)**2)", ("b",), ("b",), even=True),
    Form("Gaussian off zero", "a*exp(-(({z} - c)/b)**2)", ("b", "c"), ("b",)),
    Form("Lorentzian", "a/(1 + ({z}/b)**2)", ("b",), ("b",), even=True),
    Form("Lorentzian off zero", "a/(1 + (({z} - c)/b)**2)", ("b", "c"), ("b",)),
    Form("tanh", "a*tanh({z}/b)", ("b",), ("b",), odd=True),
    Form("saturating", "a*{z}/(abs({z}) + b)", ("b",), ("b",), odd=True),
    Form("sine", "a*sin({z}/b + c)", ("b",), ("b",), ("c",)),
    Form("hinge", "a*max(0, {z} - c)", ("c",)),
    Form("hinge below", "a*max(0, c - {z})", ("c",)),
)
