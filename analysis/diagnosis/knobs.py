"""How a search moves an effect's parameters: their size, their sign, and where it starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Knob:
    """One parameter: search coordinate is value / ``size``, or its logarithm; ``of_shot``: every shot has its own.

    ``low`` and ``high`` keep the value physical.
    """

    name: str
    size: float
    low: float = -np.inf
    high: float = np.inf
    logarithmic: bool = False
    of_shot: bool = False

    def to_search(self, value: float) -> float:
        """Return the search coordinate of a value."""
        return float(np.log(max(value, 1e-300))) if self.logarithmic else value / self.size

    def to_value(self, z: float) -> float:
        """Return the value at a search coordinate."""
        return float(np.exp(min(z, 700.0))) if self.logarithmic else z * self.size

    def slope(self, z: float) -> float:
        """Return d value / d z."""
        return self.to_value(z) if self.logarithmic else self.size

    @property
    def bounds(self) -> tuple[float, float]:
        """Get the bounds in search coordinates."""
        if self.logarithmic:
            return float(np.log(max(self.low, 1e-300))), float(np.log(self.high))
        return self.low / self.size, self.high / self.size


@dataclass(frozen=True, slots=True)
class Kind:
    """An effect as the diagnosis tries it: its knobs, and the values of the knobs it may start from.

    ``amplitude`` names the knobs in which the displacement is linear while the effect is small; the others are laid
    on a grid.  ``starts`` are complete sets of values.
    """

    name: str
    knobs: tuple[Knob, ...]
    amplitude: tuple[str, ...]
    starts: tuple[Mapping[str, float], ...]
    one_body: bool = True  # has a meaning where the plate does not move

    @property
    def shared(self) -> tuple[Knob, ...]:
        """Get the knobs that all shots share."""
        return tuple(knob for knob in self.knobs if not knob.of_shot)

    @property
    def own(self) -> tuple[Knob, ...]:
        """Get the knobs that every shot has for itself."""
        return tuple(knob for knob in self.knobs if knob.of_shot)


def _grid(low: float, high: float, step: float) -> Floats:
    """Return a geometric grid with steps of at most ``step`` (relative)."""
    count = int(np.ceil(np.log(high / low) / np.log1p(step))) + 1
    return np.geomspace(low, high, count)


def _lines(
    fixed: Mapping[str, float], low_hz: float, high_hz: float, step: float = 0.03
) -> tuple[Mapping[str, float], ...]:
    return tuple({**fixed, "frequency_hz": float(f)} for f in _grid(low_hz, high_hz, step))


def _one(name: str, parameter: str, size: float, low: float = 0.0, *, one_body: bool = True) -> Kind:
    return Kind(name, (Knob(parameter, size, low),), (parameter,), ({parameter: size},), one_body)


FREQUENCY = Knob("frequency_hz", 1.0, 1.0, 9e3, logarithmic=True)
DAMPING = Knob("damping_ratio", 1.0, 1e-4, 0.6, logarithmic=True)


def kinds() -> Sequence[Kind]:
    """Return the catalogue (EFFECTS.md section 2) as it is searched."""
    return (
        _one("coulomb_friction", "force_n", 2e-5),
        _one("viscous_drag", "coefficient_n_s_per_m", 1e-4),
        _one("quadratic_drag", "coefficient_n_s2_per_m2", 3e-4),
        _one("tilt", "angle_rad", 1e-4, -np.inf),
        _one("bearing_gradient", "stiffness_n_per_m", 1e-2, -np.inf),
        Kind(
            "block_mode",
            (Knob("mass_kg", 1e-5, 0.0, 8e-3), FREQUENCY, DAMPING),
            ("mass_kg",),
            _lines({"mass_kg": 2e-5, "damping_ratio": 0.015}, 10.0, 4000.0),
        ),
        _one("cubic_stiffness", "coefficient_n_per_m3", 1e5, -np.inf),
        _one("plate_damping", "coefficient_n_s_per_m", 2e-4, one_body=False),
        Kind(
            "viscoelastic_arm",
            (Knob("stiffness_n_per_m", 0.5, 0.0), Knob("relaxation_time_s", 1.0, 2e-5, 0.5, logarithmic=True)),
            ("stiffness_n_per_m",),
            tuple({"stiffness_n_per_m": 0.5, "relaxation_time_s": t} for t in (2e-4, 5e-4, 1.2e-3, 3e-3, 7e-3, 2e-2)),
            one_body=False,
        ),
        Kind(
            "second_plate_mode",
            (Knob("mass_kg", 1.0, 1e-5, 1e4, logarithmic=True), FREQUENCY, DAMPING),
            ("mass_kg",),
            _lines({"mass_kg": 0.1, "damping_ratio": 0.01}, 300.0, 8000.0),
            one_body=False,
        ),
        Kind(
            "support_compliance",
            (Knob("compliance_m_per_n", 1e-5, 0.0, 1e-2), FREQUENCY),
            ("compliance_m_per_n",),
            _lines({"compliance_m_per_n": 1e-6}, 200.0, 3000.0, 0.012),
            one_body=False,
        ),
        Kind(
            "plate_motion",
            (Knob("velocity_m_per_s", 1e-4, of_shot=True), Knob("displacement_m", 1e-7, of_shot=True)),
            ("velocity_m_per_s", "displacement_m"),
            ({"velocity_m_per_s": 1e-4, "displacement_m": 1e-7},),
            one_body=False,
        ),
        Kind("contact_exponent", (Knob("delta", 0.02, -0.15, 2.0),), ("delta",), ({"delta": 0.01},)),
        _one("nonlinear_contact_damping", "coefficient_n_s_per_m2", 1e3),
        Kind(
            "adhesion",
            (Knob("force_n", 1e-4, 0.0), Knob("range_m", 1.0, 1e-7, 5e-3, logarithmic=True)),
            ("force_n",),
            tuple({"force_n": 1e-4, "range_m": d} for d in (3e-6, 1e-5, 3e-5, 1e-4, 3e-4)),
        ),
        _one("sensor_drift", "ramp_m_per_s2", 1e-4, -np.inf),
        Kind(
            "demodulation_lag",
            (Knob("time_s", 1.0, 2e-7, 5e-4, logarithmic=True),),
            ("time_s",),
            ({"time_s": 1e-5},),
        ),
        Kind(
            "frame_vibration",
            (
                Knob("amplitude_m_per_s", 1e-6, 0.0),
                FREQUENCY,
                Knob("phase_rad", 1.0, of_shot=True),
            ),
            ("amplitude_m_per_s",),
            _lines({"amplitude_m_per_s": 1e-6, "phase_rad": 0.0}, 25.0, 4000.0),
        ),
        Kind(
            "cyclic_error",
            (Knob("amplitude_m", 1e-9, 0.0), Knob("phase_rad", 1.0, of_shot=True)),
            ("amplitude_m",),
            tuple({"amplitude_m": 1e-9, "order": float(k), "phase_rad": 0.0} for k in (1, 2)),
        ),
    )
