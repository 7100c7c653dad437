"""An effect, which is a row of the catalogue or a law: name, words, parameters, where it acts, and its function."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from analysis.collision.effects.kernel import Kernel
from analysis.collision.parameters import Collision, Floats


class Acts(Enum):
    """Where an effect acts."""

    ON_BLOCK = "block"  # on the block, also in flight
    ON_PLATE = "plate"  # on the plate
    IN_CONTACT = "contact"  # between the two
    AT_START = "start"  # on the plate's state at first touch
    ON_SENSOR = "sensor"  # on the measurement, not on the motion
    IN_DRIVE = "drive"  # on a slider driven by a measured force


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    ``scale`` is a natural size: a first guess, near the smallest value that one shot can show.  ``lower`` and ``upper``
    are physical limits.  ``grid`` holds the values at which a linear score is computed if the effect is not linear in
    the parameter.  ``tried`` holds the starting values of the diagnosis; the default is the grid, or else the scale.
    ``logarithmic``: it is searched by its logarithm; ``own``: every shot has its own value; ``fixed``: a fit chooses
    from the grid.
    """

    name: str
    unit: str
    scale: float
    lower: float = -math.inf
    upper: float = math.inf
    grid: tuple[float, ...] = ()
    tried: tuple[float, ...] = ()
    logarithmic: bool = False
    own: bool = False
    fixed: bool = False

    def to_search(self, value: float) -> float:
        """Return the search coordinate of a value: its logarithm, or the value in units of its ``scale``."""
        return math.log(max(value, 1e-300)) if self.logarithmic else value / (self.scale or 1.0)

    def to_value(self, z: float) -> float:
        """Return the value at a search coordinate."""
        return math.exp(min(z, 700.0)) if self.logarithmic else z * (self.scale or 1.0)

    def slope(self, z: float) -> float:
        """Return d value / d z."""
        return self.to_value(z) if self.logarithmic else self.scale or 1.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Get the bounds in search coordinates."""
        return self.to_search(self.lower), self.to_search(self.upper)


@dataclass(frozen=True, slots=True)
class SensorInput:
    """The inputs of a sensor effect: times on the recording's clock, the block's velocity, the optics.

    ``rate_hz`` is the rate of the demodulated record, which may have more samples than ``time_s``, shape (n,).
    ``measured_m``, shape (n,), is the displacement measured by the optics, where it is known at these times.
    """

    time_s: Floats
    velocity_m_per_s: Floats
    wavelength_m: float
    rate_hz: float
    measured_m: Floats | None = None


Sensor = Callable[[SensorInput, Any, Any], Any]
Rate = Callable[[Floats, Collision], float]
Clocked = Callable[[Any, Any, Any, Any], tuple[Any, Any, Any]]  # (values, k_p, m_p, time in s) -> the kernel's three
Wave = Callable[[float, Floats], list[dict[str, float]]]  # (frequency in Hz, cosine and sine per shot in m) -> values


def no_rate(_values: Floats, _collision: Collision) -> float:
    """Return 0: an effect without a rate of its own."""
    return 0.0


def no_factor(_values: Floats, _collision: Collision) -> float:
    """Return 1: an effect that does not change the contact's stiffness."""
    return 1.0


def second_as_frequency(values: Floats, _collision: Collision) -> float:
    """Return the rate of an effect whose second value is its frequency in Hz."""
    return 2 * math.pi * float(values[1])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Effect:
    """An effect that can be added to a base model: a row of docs/catalogue.md, or a law (``laws.user_law``).

    Effects of the same type and ``key`` are equal.  All functions of a row are named at module level, so that an effect
    can be sent to another process.

    ``amplitude`` names the parameter in which a small effect is linear; ``inverse``: the effect vanishes as that
    parameter grows.  ``kernel`` is the mechanical function; ``sensor`` is the function of a sensor effect on the
    displacement, shape (n, k).  ``locked`` replaces the kernel, between the two bodies, if the base model is one body
    on a contact (without it, an effect on the plate cannot act there).  ``hidden`` is the number of hidden states; they
    move the contact point by ``shift`` times the first of them; ``moves_with_block``: before the touch they move with
    the block.

    The solver chooses its steps by ``fastest``, the effect's fastest rate in rad/s for its values and the collision, by
    ``stiffens``, the factor by which it may raise the contact's stiffness, and by ``rough``: its law is not smooth at
    the start of the overlap.  For an effect on the recording's clock, ``clocked`` computes the kernel's three
    parameters from the values, the plate's stiffness and mass, and the time at which the bodies meet (all may be
    complex); the second is the rate of the hidden state at that time.

    For the search: ``response_power`` is the power of the amplitude with which a small effect grows.
    ``delay_parameter`` names the parameter that is a delay of the measurement; ``in_series`` names the compliance and
    the frequency of a spring in series with the plate's.  ``wave`` computes the values of a sensor's wave from its
    cosine and sine in every shot.  ``widens`` names the simpler effect that this one extends; this one is tried only if
    the simpler one was found.  ``needs_full_rate``: visible only at the record's own rate; ``at_rest``: visible in a
    record without a collision.
    """

    name: str
    words: str
    acts: Acts
    parameters: tuple[Parameter, ...]
    amplitude: str
    kernel: Kernel | None = None
    sensor: Sensor | None = None
    hidden: int = 0
    shift: float = 0.0
    moves_with_block: bool = False
    rough: bool = False
    nonlinear: bool = False  # in the state; no linearity check, whose test states may give no force
    kinked: bool = False  # has corners or steps that are not events
    range_at: int = -1  # index of the parameter that is the range of the effect
    inverse: bool = False
    has_memory: bool = False  # the measurement depends on earlier displacements
    optical: bool = False  # applies only to a measurement with light of known wavelength
    response_power: float = 1.0
    delay_parameter: str = ""
    in_series: tuple[str, str] | None = None
    wave: Wave | None = None
    clocked: Clocked | None = None
    widens: str = ""
    needs_full_rate: bool = False
    at_rest: bool = False
    fastest: Rate = no_rate
    stiffens: Rate = no_factor
    locked: Kernel | None = None
    look_alikes: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Get the unique key of the effect in files and in a fit's parameters: here its name."""
        return self.name

    @property
    def short_words(self) -> str:
        """Get the effect's name for sentences and narrow table cells."""
        return self.name.replace("_", " ")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Effect) and type(self) is type(other) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.key!r})"

    @property
    def one_body(self) -> bool:
        """Get whether the effect can act when the plate is locked."""
        return self.acts not in (Acts.ON_PLATE, Acts.AT_START) or self.locked is not None

    @property
    def changes_contact(self) -> bool:
        """Get whether the effect makes the first contact differ from two bodies with a spring and a dashpot."""
        return self.acts in (Acts.ON_PLATE, Acts.IN_CONTACT, Acts.AT_START) or self.hidden > 0

    @property
    def own(self) -> bool:
        """Get whether every shot has its own values of all parameters."""
        return all(parameter.own for parameter in self.parameters)

    def has_simpler_look_alike(self, other: "Effect") -> bool:
        """Return whether another effect imitates this one with fewer parameters."""
        return other.name in self.look_alikes and len(other.parameters) < len(self.parameters)

    def index(self, name: str) -> int:
        """Return the index of a parameter.  Raises ValueError."""
        for place, parameter in enumerate(self.parameters):
            if parameter.name == name:
                return place
        raise ValueError(f"{self.name} has no parameter {name!r}; it has {', '.join(p.name for p in self.parameters)}")


def frequencies(low_hz: float, high_hz: float, step: float = 0.03) -> tuple[float, ...]:
    """Return a geometric grid; steps of at most 3 % are fine enough to find a line between two grid points."""
    count = math.ceil(math.log(high_hz / low_hz) / math.log1p(step)) + 1
    return tuple(float(f) for f in np.geomspace(low_hz, high_hz, count))
