"""The blind cases of the closed loop: which rigs, how strong, in which noise; and running one of them."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulation import demodulate
from analysis.signal.record import motion_from_displacement
from instrument.bench.effects import CATALOGUE, OFF_CATALOGUE
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import DURATION_S, SAMPLE_RATE_HZ, record_shot
from tests.bench.blind import RATE_HZ, Record, Truth, drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind, displacement_noise_m
from tests.bench.separation import separation
from tests.bench.strength import Tangents, at_snr, base_tangents, cramer_rao, residual_snr

SNRS = (13.0, 20.0, 40.0, 100.0, 300.0)
RAW = ("eight_bit", "low_light", "no_reference")
MIN_SNR = 12.0
APART = 5.0  # noise norms: below, no method could tell an effect from its nearest look-alike
_DRAWS = 6  # of a rig, until its effect can stand out as asked for


@dataclass(frozen=True, slots=True)
class Case:
    """One blind set before it is drawn."""

    kind: str  # "clean" | "single" | "natural" | "pair" | "beyond" | "raw"
    names: tuple[str, ...]
    snr: float  # asked for; 0: the size it was drawn with
    noise: str
    seed: int
    raw: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was true, what was said; parameters as {name: {parameter: number}}."""

    case: Case
    snr: float
    verdict: str
    named: tuple[str, ...] = ()  # first names, in the order reported
    classes: tuple[tuple[str, ...], ...] = ()  # what each was said to be indistinguishable from
    truth: dict[str, dict[str, float]] = field(default_factory=dict)
    found: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)  # value, standard uncertainty
    bound: dict[str, dict[str, float]] = field(default_factory=dict)  # Cramer-Rao
    held_out: tuple[float, float] | None = None  # displacement rms in m, before and after
    noise_m: float = 0.0
    seconds: float = 0.0
    problem: str = ""
    nearest: str = ""  # the catalogue effect that could imitate it best; of two, the one that is imitated more
    apart: float | None = None  # what even that one cannot imitate, over the noise; of two, the other
    removed: tuple[str, ...] = ()  # effects that the demodulation removed from every shot, with a flag that says so

    def as_json(self) -> dict[str, Any]:
        """Return a plain dictionary."""
        return asdict(self)


def cases(runs: dict[str, int], seed: int) -> list[Case]:
    """Return the cases for ``runs`` a cell: clean (a noise kind), single, natural, beyond (an effect), pair, raw."""
    random = np.random.default_rng((seed, 0x100))
    result: list[Case] = []

    def add(kind: str, names: Sequence[str], snr: float, noise: str = "white", raw: str = "") -> None:
        result.append(Case(kind, tuple(names), snr, noise, seed * 1_000_003 + len(result), raw))

    for noise in NoiseKind:
        for _ in range(runs["clean"]):
            add("clean", (), 0.0, noise.value)
    for place, name in enumerate(CATALOGUE):
        for i in range(runs["single"]):
            add("single", (name,), SNRS[(place + i) % len(SNRS)])
        for _ in range(runs["natural"]):
            add("natural", (name,), 0.0)
    for i in range(runs["pair"]):
        add("pair", [str(n) for n in random.choice(list(CATALOGUE), 2, replace=False)], (40.0, 100.0, 300.0)[i % 3])
    for place, name in enumerate(OFF_CATALOGUE):
        for i in range(runs["beyond"]):
            add("beyond", (name,), SNRS[(place + i) % len(SNRS)])
    for raw in RAW:
        for i in range(runs["raw"]):
            names = () if i % 4 == 0 else (str(random.choice(list(CATALOGUE))),)
            add("raw", names, 60.0, "white", raw)
    return result


@dataclass(frozen=True, slots=True)
class Drawn:
    """The rig of a case, how far its effects stand out, and what could be known of them at best."""

    truth: Truth
    snr: float = 0.0
    bound: dict[str, dict[str, float]] = field(default_factory=dict)
    nearest: str = ""
    apart: float | None = None


def draw(case: Case, *, bounded: bool = True) -> Drawn:
    """Draw the rig of a case; one that cannot stand out as asked is drawn again a few times.

    Not ``bounded``: without what could be known of its effects at best, which costs some ten seconds.
    """
    noise = Noise(NoiseKind(case.noise), white_m=_white_m(case))
    if not case.names:
        return Drawn(drawn((), case.seed, noise))
    for attempt in range(_DRAWS):
        truth = drawn(case.names, case.seed + 7919 * attempt, noise)
        tangents = base_tangents(truth)
        if case.snr == 0.0:
            reached = residual_snr(truth, tangents)
        elif len(case.names) == 1:
            truth, reached = at_snr(truth, case.snr, tangents)
        else:  # each by itself, so that neither drowns in the other
            parts = [at_snr(replace(truth, effects={n: truth.effects[n]}), case.snr, tangents) for n in case.names]
            reached = min(part[1] for part in parts)
            truth = replace(truth, effects={n: part[0].effects[n] for n, part in zip(case.names, parts, strict=True)})
        if reached >= MIN_SNR:
            break
    if not bounded:
        return Drawn(truth, reached)
    nearest, apart = "", None
    if case.kind in ("single", "beyond") and reached >= MIN_SNR:
        others = separation(truth, tangents)
        nearest = min(others, key=others.__getitem__)
        apart = others[nearest]
    if case.kind == "pair" and reached >= MIN_SNR:
        nearest, apart = min(_beside(truth, tangents), key=lambda one: one[1])
    return Drawn(truth, reached, cramer_rao(truth, tangents), nearest, apart)


def _beside(truth: Truth, tangents: Tangents) -> list[tuple[str, float]]:
    """Return each effect of two with what the other cannot imitate of it, over the noise."""
    found = []
    for name in truth.effects:
        (other,) = set(truth.effects) - {name}
        alone = replace(truth, effects={name: truth.effects[name]})
        found.append((name, separation(alone, tangents, (other,))[other]))
    return found


def motions(truth: Truth, case: Case) -> tuple[Motion, ...]:
    """Return what the analysis is given."""
    if case.kind != "raw":
        return tuple(as_motion(record) for record in records(truth))
    rig = Bench(bodies=truth.bodies, effects=truth.effects, optics=_optics(case.raw), floor_m=0.0, seed=truth.seed)
    return recorded_motions(rig, truth)


def recorded_motions(rig: Bench, truth: Truth) -> tuple[Motion, ...]:
    """Return the shots of a truth as ``rig`` records them and the analysis demodulates them."""
    shots = (record_shot(rig, i, v, SAMPLE_RATE_HZ, DURATION_S)[0] for i, v in enumerate(truth.speeds_m_per_s))
    return tuple(demodulate(shot, AnalysisSettings()) for shot in shots)


def as_motion(record: Record) -> Motion:
    """Return a blind record as the demodulator would have given it."""
    motion = motion_from_displacement(
        record.time_s, record.displacement_m, None, None, record.moving_mass_kg, 1e-6, AnalysisSettings().bandwidth_hz
    )
    std = np.full(record.time_s.size, record.noise_m)
    return replace(motion, wavelength_m=record.wavelength_m, displacement_std_m=std)


def judge(case: Case, diagnose: Callable[[Sequence[Motion]], Any]) -> Outcome:
    """Draw a case, have it diagnosed, and write down what was said beside what was true."""
    rig = draw(case)
    truth, snr = rig.truth, rig.snr
    shown = motions(truth, case)
    began = time.perf_counter()
    try:
        said = diagnose(shown)
    except Exception as error:
        problem = f"{type(error).__name__}: {error}"[:200]
        return Outcome(case, snr, "failed", truth=dict(truth.effects), problem=problem, apart=rig.apart)
    seconds = time.perf_counter() - began
    held = None
    if said.error_held_out_before is not None and said.error_held_out_after is not None:
        held = (said.error_held_out_before.displacement_rms_m, said.error_held_out_after.displacement_rms_m)
    found = {
        effect.name: {
            key: (value.value, value.std) for key, value in effect.parameters.items() if isinstance(value, Quantity)
        }
        for effect in said.effects
    }
    leak_removed = all("leak_removed" in motion.flags for motion in shown)
    return Outcome(
        case=case,
        snr=snr,
        verdict=str(said.verdict),
        named=tuple(effect.name for effect in said.effects),
        removed=("cyclic_error",) if leak_removed else (),
        classes=tuple(tuple(other.name for other in effect.indistinguishable_from) for effect in said.effects),
        truth={name: dict(values) for name, values in truth.effects.items()},
        found=found,
        bound=rig.bound,
        held_out=held,
        noise_m=truth.noise.white_m,
        seconds=seconds,
        nearest=rig.nearest,
        apart=rig.apart,
    )


def _optics(raw: str) -> Optics:
    if raw == "eight_bit":
        return Optics(bits=8)
    if raw == "low_light":
        return Optics(measurement_v=0.06, measurement_snr_db=18.0, reference_v=0.08, reference_snr_db=20.0)
    return Optics(with_reference=False)


def _white_m(case: Case) -> float:
    if case.kind != "raw":
        return 1e-10
    optics = _optics(case.raw)
    counts = optics.measurement_v / optics.volts_per_count
    rounding = (1 / 12) / (counts**2 / 2)  # of the digitizer's steps, as noise over signal
    snr_db = -10 * np.log10(10 ** (-optics.measurement_snr_db / 10) + rounding)
    return displacement_noise_m(replace(optics, measurement_snr_db=float(snr_db)), 10e6, RATE_HZ, both=False)
