"""Sets of displacement records for blind statistics: thousands of shots without making a single count.

What is drawn is a ``Truth``; what the analysis may see is a tuple of ``Record``.  Nothing in a record tells of the
truth but the motion itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import DEFAULT_WAVELENGTH_AIR_M
from instrument.bench.effects import Effects, complete, draw, effects_of_shot, force_slots
from instrument.bench.frame import Frame, frame_of
from instrument.bench.measured_path import clamp_motion, measured_path, with_cyclic_error
from instrument.bench.mechanics import Bodies, Trajectory, collide
from instrument.bench.optics import Optics
from instrument.bench.site import QUIET, Site
from tests.bench.displacement_noise import Noise, cyclic_m

Floats = NDArray[np.float64]

RATE_HZ = 100e3
DURATION_S = 0.06
BEFORE_TOUCH_S = 0.012
_STEPS_S = (8e-6, 2e-5)  # in contact, in flight: below 0.1 pm off at the ends of a shot
_NONE: Mapping[str, float] = {}


@dataclass(frozen=True, slots=True)
class Record:
    """One shot as demodulated: times (s) and displacement (m) of shape (n,), and the optics' white noise (m)."""

    time_s: Floats
    displacement_m: Floats
    noise_m: float
    moving_mass_kg: float
    wavelength_m: float


@dataclass(frozen=True, slots=True)
class Take:
    """How one shot is taken: weights put on the block, and how much of its flight the record holds."""

    added_kg: float = 0.0
    before_touch_s: float = BEFORE_TOUCH_S
    duration_s: float = DURATION_S


_USUAL = Take()


@dataclass(frozen=True, slots=True)
class Truth:
    """What a set was made of; ``effects`` as of the first shot, see ``effects_of_shot`` for the others.

    ``takes`` say how the first shots were taken, the others are taken as usual.
    """

    bodies: Bodies
    effects: Effects
    speeds_m_per_s: tuple[float, ...]
    noise: Noise
    seed: int
    site: Site = QUIET
    takes: tuple[Take, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Get the names of the effects."""
        return tuple(self.effects)

    def of_shot(self, shot: int) -> dict[str, dict[str, float]]:
        """Return the effects of one shot."""
        return effects_of_shot(self.effects, shot, self.seed)

    def take(self, shot: int) -> Take:
        """Return how a shot is taken."""
        return self.takes[shot] if shot < len(self.takes) else _USUAL

    def block_mass_kg(self, shot: int) -> float:
        """Return what moves in a shot, its weights included."""
        return self.bodies.block_mass_kg + self.take(shot).added_kg


def drawn(names: Sequence[str], seed: int, noise: Noise | None = None, shots: int = 3, site: Site = QUIET) -> Truth:
    """Draw a rig with the effects called ``names``: bodies near the paper's, speeds a hand would give."""
    random = np.random.default_rng((seed, 0xB))
    paper = Bodies()
    bodies = replace(
        paper,
        plate_mass_kg=paper.plate_mass_kg * float(random.uniform(0.85, 1.15)),
        plate_stiffness_n_per_m=paper.plate_stiffness_n_per_m * float(random.uniform(0.9, 1.1)),
        contact_stiffness_n_per_m=paper.contact_stiffness_n_per_m * float(random.uniform(0.7, 1.4)),
        contact_damping_n_s_per_m=paper.contact_damping_n_s_per_m * float(random.uniform(0.7, 1.4)),
    )
    speeds = np.linspace(0.17, 0.41, shots) if shots > 1 else np.array([0.265])
    speeds = speeds + random.uniform(-0.02, 0.02, shots)
    effects = {name: draw(name, random) for name in names}
    return Truth(bodies, effects, tuple(float(s) for s in speeds), noise or Noise(), seed, site)


def run(truth: Truth, shot: int, bodies: Bodies | None = None, speed_m_per_s: float | None = None) -> Trajectory:
    """Let one shot of ``truth`` happen, with other bodies or another speed where given."""
    effects = truth.of_shot(shot)
    take = truth.take(shot)
    speed = truth.speeds_m_per_s[shot] if speed_m_per_s is None else speed_m_per_s
    motion = effects.get("plate_motion", _NONE)
    bare = bodies or truth.bodies
    return collide(
        -speed,
        bodies=replace(bare, block_mass_kg=bare.block_mass_kg + take.added_kg),
        extra=force_slots(effects),
        distance_m=truth.speeds_m_per_s[shot] * take.before_touch_s,
        duration_s=take.duration_s,
        plate_at_touch=(motion.get("displacement_m", 0.0), motion.get("velocity_m_per_s", 0.0)),
        steps_s=_STEPS_S,
        frame=clamp_motion(_frame(truth, shot), effects),
    )


def _frame(truth: Truth, shot: int) -> Frame | None:
    if not truth.site.moves:
        return None
    seed = int(np.random.default_rng((truth.seed, shot, 0x5E)).integers(2**62))
    return frame_of(truth.site, seed).with_knocks(0.0, shot)


def times_s(take: Take = _USUAL) -> Floats:
    """Return the times of a record's samples."""
    return np.arange(round(take.duration_s * RATE_HZ)) / RATE_HZ


def clean_m(
    truth: Truth,
    shot: int,
    bodies: Bodies | None = None,
    speed_m_per_s: float | None = None,
    time_s: Floats | None = None,
) -> Floats:
    """Return what the optics would show of one shot without noise, in m at ``time_s`` (default: its record's)."""
    effects = truth.of_shot(shot)
    time_s = times_s(truth.take(shot)) if time_s is None else time_s
    trajectory = run(truth, shot, bodies, speed_m_per_s)
    x, v = measured_path(trajectory, effects, time_s)
    optics = with_cyclic_error(Optics(wavelength_m=DEFAULT_WAVELENGTH_AIR_M), effects)
    if optics.leak_m != 0.0:
        x = x + _passed(optics, v) * cyclic_m(optics, x)
    return x


def records(truth: Truth) -> tuple[Record, ...]:
    """Return the shots of a set, with noise.  Cost: about 3 ms a shot."""
    truth = replace(truth, effects=complete(truth.effects))
    random = np.random.default_rng((truth.seed, 0x17))
    result = []
    for shot in range(len(truth.speeds_m_per_s)):
        x = clean_m(truth, shot)
        x = x - x[0] + truth.noise.draw(x.size, RATE_HZ, random)
        time_s, mass_kg = times_s(truth.take(shot)), truth.block_mass_kg(shot)
        result.append(Record(time_s, x, truth.noise.white_m, mass_kg, DEFAULT_WAVELENGTH_AIR_M))
    return tuple(result)


def _passed(optics: Optics, velocity_m_per_s: Floats) -> Floats:
    """Return how much of the cyclic error's chirp reaches a record: as measured on counts, half of it at 52 kHz."""
    line_hz = 2 * np.abs(velocity_m_per_s) / optics.wavelength_m * optics.leak_order
    u = np.clip((line_hz / RATE_HZ - 0.38) / 0.28, 0.0, 1.0)
    return 0.5 * (1 + np.cos(np.pi * u))
