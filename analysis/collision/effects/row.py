"""One row of the catalogue: what an effect is called, what it takes and where it acts."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.kernel import Kernel
from analysis.collision.parameters import Collision

Floats = NDArray[np.float64]


class Acts(Enum):
    """Where an effect comes in."""

    ON_BLOCK = "block"  # on the block, in flight too
    ON_PLATE = "plate"  # on the plate
    IN_CONTACT = "contact"  # between the two
    AT_START = "start"  # the plate's state at first touch
    ON_SENSOR = "sensor"  # on what is measured, not on what moves


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    ``scale`` is a natural size (a first guess, of the order that one shot can just show or somewhat above);
    ``lower`` and ``upper`` keep it physical; ``grid`` holds the values at which a linear score is to be taken where
    the effect is not linear in it; ``tried`` those from which the diagnosis starts, where they are not the grid (or,
    without one, the scale); ``logarithmic`` says that the diagnosis searches it by its logarithm, as fits a size not
    known to a power of ten; ``own`` that every shot has its own; ``fixed`` that a fit chooses among the grid instead of
    moving it; ``nuisance`` that it belongs to the fit but to no result.
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
    nuisance: bool = False

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
class Sensed:
    """What a sensor effect may ask: times on the recording's clock, the block's velocity, the optics.

    ``rate_hz`` is that of the demodulated record, which may hold more samples than ``time_s``, shape (n,).
    """

    time_s: Floats
    velocity_m_per_s: Floats
    wavelength_m: float
    rate_hz: float


Sensor = Callable[[Sensed, Any, Any], Any]
Rate = Callable[[Floats, Collision], float]
Clocked = Callable[[Any, Any, Any, Any], tuple[Any, Any, Any]]  # (values, k_p, m_p, time in s) -> the kernel's three
Wave = Callable[[float, Floats], list[dict[str, float]]]  # (frequency in Hz, cosine and sine a shot in m) -> values


@dataclass(frozen=True, slots=True)
class Effect:
    """A row of the catalogue (docs/catalogue.md).

    ``amplitude`` names the parameter in which the effect is linear near nothing; ``inverse`` says that the effect
    vanishes as that parameter grows.  ``kernel`` is the mechanical function, ``sensor`` the one on the displacement,
    shape (n, k), of a sensor effect; ``locked`` takes the kernel's place, between the two bodies, where the base model
    is one body on a contact (without it what acts on the plate has no meaning there).  ``hidden`` states follow the
    block before the touch if they ride with it, and move the contact point by ``shift`` times the first of them.  Of
    its values and the collision ``fastest`` gives the fastest rate in rad/s that the effect brings, ``stiffens`` by
    what factor it may raise the contact's stiffness, ``rough`` says that its law is not smooth where the overlap
    begins: the integrators suit their steps to them.  What goes on by the recording's clock is told when the bodies
    meet: ``clocked`` makes the kernel's three parameters of the values, plate stiffness and mass, and that time (all of
    them may be complex); the second is the rate at which the hidden state changes then.

    What a search makes use of: ``grows_as`` is the power of the amplitude in which the effect grows where it is small;
    ``delays`` names the parameter by which everything is shown late; ``in_series`` those of a spring's compliance and
    frequency that stands in series with the plate's; ``wave`` makes the values of a sensor's wave from the cosine and
    the sine it adds to every shot.  ``widens`` names the effect of which this is the wider one: it is asked only where
    that one was found.  ``ripples`` says that it shows only at the record's own rate, ``at_rest`` that a
    record without a collision shows it.
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
    rides: bool = False
    rough: bool = False
    bent: bool = False  # not linear in the state, wherever that is asked: it may well be zero there
    kinked: bool = False  # has corners or steps where no event lies
    range_at: int = -1  # which parameter is the range within which the bodies must be
    inverse: bool = False
    remembers: bool = False  # what the sensor shows at an instant depends on what it saw before
    optical: bool = False  # has a meaning only where light of a known wavelength measures
    grows_as: float = 1.0
    delays: str = ""
    in_series: tuple[str, str] | None = None
    wave: Wave | None = None
    clocked: Clocked | None = None
    widens: str = ""
    ripples: bool = False
    at_rest: bool = False
    fastest: Rate = field(default=lambda _values, _collision: 0.0)
    stiffens: Rate = field(default=lambda _values, _collision: 1.0)
    locked: Kernel | None = None
    look_alikes: tuple[str, ...] = ()

    @property
    def one_body(self) -> bool:
        """Return whether the effect has a meaning where the plate does not move."""
        return self.acts not in (Acts.ON_PLATE, Acts.AT_START) or self.locked is not None

    @property
    def changes_contact(self) -> bool:
        """Return whether the first contact is no longer that of two bodies, a spring and a dashpot with it."""
        return self.acts in (Acts.ON_PLATE, Acts.IN_CONTACT, Acts.AT_START) or self.hidden > 0

    @property
    def own(self) -> bool:
        """Return whether every shot has its own values of all parameters."""
        return all(parameter.own for parameter in self.parameters)

    def index(self, name: str) -> int:
        """Return the place of a parameter; ValueError where there is none of that name."""
        for place, parameter in enumerate(self.parameters):
            if parameter.name == name:
                return place
        raise ValueError(f"{self.name} has no parameter {name!r}; it has {', '.join(p.name for p in self.parameters)}")


def frequencies(low_hz: float, high_hz: float, step: float = 0.03) -> tuple[float, ...]:
    """Return a geometric grid; steps of at most 3 % keep a line from falling between two points."""
    count = math.ceil(math.log(high_hz / low_hz) / math.log1p(step)) + 1
    return tuple(float(f) for f in np.geomspace(low_hz, high_hz, count))
