"""Blind sets of a bench in a building: clean ones, and effects scaled so that they stand out of what the site does."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.inference.model.base import base_named
from analysis.inference.model.samples import Samples, averaged_shots
from analysis.inference.noise.floor import white_floor
from analysis.inference.noise.site import Site
from analysis.inference.noise.sway import Sway, frame_response_of
from analysis.shot.impact import VibrationSpectrum
from analysis.shot.motion import Motion
from instrument.bench.effects import CATALOGUE
from instrument.bench.frame import HIGHEST_HZ, LOWEST_HZ, density_m2_per_hz
from instrument.bench.rig import Bench
from instrument.bench.site import QUIET, site_named
from tests.bench.blind import Truth, clean_m, drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind
from tests.bench.scaled import scaled
from tests.bench.strength import base_tangents, strongest
from tests.benchmarks.loop_cases import as_motion, recorded_motions

Floats = NDArray[np.float64]
OF_A_SITE = ("plate_motion", "frame_vibration")  # what a building does by itself: no finding there
EFFECTS = tuple(name for name in CATALOGUE if name not in OF_A_SITE)
NORMS = 12.0
_APART_HZ = 4.0  # of the sines that stand for a site
_SMALL = 0.02  # of the strength drawn, to first order
_TURNS = 2  # of scaling


@dataclass(frozen=True, slots=True)
class Case:
    """One set: where the bench stands, the effect it has ("": none) of so many noise norms, and its seed.

    ``recorded``: both beats are recorded, with a path that wanders, and demodulated; otherwise the displacement has
    white noise alone.
    """

    site: str
    effect: str
    seed: int
    norms: float = NORMS
    recorded: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was said; ``norms`` is how far the effect stands out, to first order."""

    case: Case
    norms: float
    truth: dict[str, float]
    verdict: str
    named: tuple[str, ...] = ()
    classes: tuple[tuple[str, ...], ...] = ()
    found: dict[str, tuple[float, float]] = field(default_factory=dict)  # of the true effect: value, std
    seconds: float = 0.0  # of CPU
    problem: str = ""

    @property
    def score(self) -> str:
        """Get how well that is: "right", "in the class", "with a false partner", "wrong", "unnamed" or "missed"."""
        true = self.case.effect
        if not self.named:
            right = "missed" if true else "right"
            return right if self.verdict == "adequate" else "failed" if self.verdict == "failed" else "unnamed"
        sides = [{name, *others} for name, others in zip(self.named, self.classes, strict=True)]
        if not any(true in side for side in sides):
            return "wrong"
        if len(sides) > 1:
            return "with a false partner"
        return "right" if sides == [{true}] else "in the class"

    def as_json(self) -> dict[str, Any]:
        """Return a plain dictionary."""
        return asdict(self)


def from_json(values: dict[str, Any]) -> Outcome:
    """Return the outcome that a kept line holds."""
    named, classes = tuple(values["named"]), tuple(tuple(others) for others in values["classes"])
    return Outcome(**{**values, "case": Case(**values["case"]), "named": named, "classes": classes})


def draw(case: Case) -> tuple[Truth, float]:
    """Return the rig of a case, and by how many norms of the site's noise its effect stands out."""
    names = (case.effect,) if case.effect else ()
    truth = drawn(names, case.seed, Noise(NoiseKind.WHITE, white_m=1e-10), site=site_named(case.site))
    if not case.effect:
        return truth, 0.0
    size = norms(truth)
    for _ in range(_TURNS):  # what an effect adds is not in proportion to its strength as far as it was drawn
        strength = min(case.norms / size, strongest(truth))
        truth = replace(truth, effects=scaled(truth.effects, strength))
        size = norms(truth)
    return truth, size


def norms(truth: Truth) -> float:
    """Return the norm of what an effect adds to a set, to first order, whitened by noise and site, beside the base.

    Speed, touch and offset of each shot and the base parameters of all are free; the plate may swing.
    """
    still = replace(truth, site=QUIET, effects={})
    slight = replace(still, effects=scaled(truth.effects, _SMALL))
    shots = averaged_shots([as_motion(record) for record in records(replace(still, seed=truth.seed))])
    sways = [_sway(truth, index, shot) for index, shot in enumerate(shots)]
    tangents = np.split(base_tangents(still).columns, len(shots))
    rows = []
    for index, (shot, sway, columns) in enumerate(zip(shots, sways, tangents, strict=True)):
        adds = (clean_m(slight, index) - clean_m(still, index)) / _SMALL
        both = shot.averaged(np.column_stack([adds, columns]))[shot.valid] / shot.white_m
        noise = replace(white_floor(shot.white_m / shot.weight, shot.spacing_s), site=(0.0,))
        rows.append(sway.whiten(both, noise))
    whole = np.concatenate(rows)
    left, free = whole[:, 0], whole[:, 1:] / np.linalg.norm(whole[:, 1:], axis=0)
    return float(np.linalg.norm(left - free @ np.linalg.lstsq(free, left, rcond=1e-12)[0]))


def _sway(truth: Truth, index: int, shot: Samples) -> Sway:
    """Return what the true site may do to a shot."""
    frequency = np.arange(LOWEST_HZ + 0.5 * _APART_HZ, HIGHEST_HZ, _APART_HZ)
    floor = VibrationSpectrum(
        frequency, density_m2_per_hz(truth.site, frequency) * _APART_HZ, np.ones(frequency.size, np.bool_)
    )
    lines = truth.site.lines
    at, power = [line.frequency_hz for line in lines], [0.5 * line.amplitude_m**2 for line in lines]
    known = np.arange(frequency.size + len(lines)) < frequency.size
    vibration = VibrationSpectrum(np.append(floor.frequency_hz, at), np.append(floor.power_m2, power), known)
    site = Site(vibration, np.zeros(known.size, np.int64), 1)
    base = base_named("paper")
    shared = np.array([getattr(truth.bodies, name) for name in base.names])
    own = np.array([-truth.speeds_m_per_s[index], truth.take(index).before_touch_s, 0.0])
    return frame_response_of(shot, site, base, shared, own, {})


def motions_of(truth: Truth, case: Case) -> Sequence[Motion]:
    """Return what the analysis is given."""
    if not case.recorded:
        return [as_motion(record) for record in records(truth)]
    rig = Bench(bodies=truth.bodies, effects=truth.effects, site=truth.site, seed=truth.seed)
    return recorded_motions(rig, truth)


def judge(case: Case, diagnose: Callable[[Sequence[Motion]], Any]) -> Outcome:
    """Draw a case, have it diagnosed, and write down what was said beside what was true."""
    truth, size = draw(case)
    true = dict(truth.effects.get(case.effect, {}))
    motions = motions_of(truth, case)
    began = time.process_time()
    try:
        said = diagnose(motions)
    except Exception as error:
        return Outcome(case, size, true, "failed", problem=f"{type(error).__name__}: {error}"[:200])
    found = next((effect.parameters for effect in said.effects if effect.name == case.effect), {})
    return Outcome(
        case,
        size,
        true,
        str(said.verdict),
        tuple(effect.name for effect in said.effects),
        tuple(tuple(other.name for other in effect.indistinguishable_from) for effect in said.effects),
        {name: (value.value, value.std) for name, value in found.items()},
        time.process_time() - began,
        said.sentence if str(said.verdict) in ("unexplained", "partly_explained") else "",
    )
