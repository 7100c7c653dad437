"""List the shots that an operator could take next, with the effort of each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the settings import the limits of the rig from here, and must not import the diagnosis with them
    from analysis.collision import Effect
    from analysis.diagnosis import Diagnosis
    from analysis.inference import Samples
    from analysis.shot import Motion

SPEEDS_M_PER_S = (0.05, 0.10, 0.20, 0.35, 0.60)
ADDED_KG = (0.0, 0.05)
MAX_SHOTS = 3  # of a plan
MAX_MEMBERS = 4  # models that are compared
_OTHER_WEIGHTS = 0.5  # effort of a change of weights, in shots
_LONGER = 0.1  # effort of a longer record, in shots
_SAME_MASS = 1e-5  # relative: the same block weighed twice
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True, slots=True)
class NextShot:
    """The settings of a shot: speed at the touch, mass added to the block, recorded flight before and after contact."""

    speed_m_per_s: float
    added_mass_kg: float
    before_s: float
    after_s: float
    longer: bool = False  # than the present shots

    @property
    def words(self) -> str:
        weights = f" with {1e3 * self.added_mass_kg:.4g} g added" if self.added_mass_kg else ""
        record = f", recorded from {1e3 * self.before_s:.0f} ms before the touch to {1e3 * self.after_s:.0f} ms after"
        return f"{self.speed_m_per_s:.2g} m/s{weights}{f'{record} the contact' if self.longer else ''}"

    def to_json(self) -> dict[str, float | str]:
        names = ("speed_m_per_s", "added_mass_kg", "before_s", "after_s", "words")
        return {name: getattr(self, name) for name in names}


def shots_in_words(sequence: Sequence[NextShot]) -> str:
    """Return shots in words, with equal shots counted together."""
    counted: dict[str, int] = {}
    for shot in sequence:
        counted[shot.words] = counted.get(shot.words, 0) + 1
    parts = [f"{_NUMBERS[n] if n < len(_NUMBERS) else n} shot{'s' if n > 1 else ''} at {w}" for w, n in counted.items()]
    text = " and ".join(parts)
    return text[:1].upper() + text[1:]


@dataclass(frozen=True, slots=True)
class Reach:
    """The limits of the rig: speeds and weights to choose from, free path before the plate, recorded flight after."""

    speeds_m_per_s: tuple[float, ...] = SPEEDS_M_PER_S
    added_kg: tuple[float, ...] = ADDED_KG
    run_up_m: float = 12e-3
    after_s: float = 0.12

    def before_s(self, speed_m_per_s: float) -> float:
        """Return the longest free flight before the touch."""
        return 0.95 * self.run_up_m / speed_m_per_s


def mass_without_weights_kg(shots: Sequence[Samples] | Sequence[Motion]) -> float:
    """Return the mass of the block without weights: the smallest of the shots'."""
    return min(shot.moving_mass_kg for shot in shots)


def on_the_rig(shots: Sequence[Samples]) -> list[Samples]:
    """Return the shots taken on the plate that is on the rig now, which is that of the last shot."""
    return [shot for shot in shots if shot.plate_number == shots[-1].plate_number]


def contact_s(shot: NextShot, shots: Sequence[Samples]) -> float:
    """Return the expected contact time in s, which grows with the root of the mass."""
    like = on_the_rig(shots)[0]
    mass_kg = mass_without_weights_kg(shots) + shot.added_mass_kg
    return like.course.contact_time_s * math.sqrt(mass_kg / like.moving_mass_kg)


def effort(sequence: Sequence[NextShot], on_the_block_kg: float) -> float:
    """Return the effort of a sequence in shots: a change of weights is half a shot, a longer record a tenth."""
    total, on = 0.0, on_the_block_kg
    for shot in sequence:
        total += 1.0 + _LONGER * shot.longer
        total += _OTHER_WEIGHTS * (abs(shot.added_mass_kg - on) > _SAME_MASS)
        on = shot.added_mass_kg
    return total


def in_order(sequence: Sequence[NextShot], on_the_block_kg: float) -> tuple[NextShot, ...]:
    """Return the shots in the order of least effort: those with the weights that are on the block first."""
    return min(itertools.permutations(sequence), key=lambda order: effort(order, on_the_block_kg))


def next_shots(shots: Sequence[Samples], reach: Reach) -> list[NextShot]:
    """Return the possible shots: every speed and weight, recorded as long as the present shots and at full length."""
    before, after = usual_flights(shots)
    out = []
    for speed, added in itertools.product(reach.speeds_m_per_s, reach.added_kg):
        usual = NextShot(speed, added, min(before, reach.before_s(speed)), min(after, reach.after_s))
        longest = NextShot(speed, added, max(usual.before_s, min(reach.before_s(speed), 0.1)), reach.after_s, True)
        out.append(usual)
        if longest.before_s + longest.after_s > 1.3 * (usual.before_s + usual.after_s):
            out.append(longest)
    return out


def usual_flights(shots: Sequence[Samples]) -> tuple[float, float]:
    """Return the flight that all present shots hold before the touch and after the release, in s."""
    before = min(shot.course.touch_time_s - float(shot.centre_s[0]) for shot in shots)
    after = min(float(shot.centre_s[-1]) - shot.course.release_time_s for shot in shots)
    return max(before, 2e-3), max(after, 5e-3)


def first_indistinguishable(diagnosis: Diagnosis) -> tuple[Effect, ...]:
    """Return the first effect that the diagnosis could not distinguish from others, then these; () if there is none."""
    for found in diagnosis.effects:
        if found.indistinguishable_from:
            return (found.effect, *found.indistinguishable_from[: MAX_MEMBERS - 1])
    return ()
