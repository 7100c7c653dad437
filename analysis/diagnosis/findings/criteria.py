"""Every threshold of a diagnosis, with its unit, its meaning and the source of its value.

Limits on the cost of a search (numbers of fits and steps) and numerical tolerances stay in the files that use them:
they change how long a diagnosis takes, not its verdict on a fit.
"""

import math
from dataclasses import dataclass, field
from typing import Any

_KASS = "Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773: very strong evidence"
_SIMULATED = "simulated sets of known truth"
_DRIVES = "simulated drives of known truth"
_CONVENTION = "convention"


def _is(value: float, unit: str, meaning: str, source: str) -> Any:
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})


@dataclass(frozen=True, slots=True)
class Criteria:
    """The thresholds; the metadata of each field are its unit, meaning and source."""

    least_fall: float = _is(10.0, "BIC", "fall for an effect to join, in addition to the cost of choice", _KASS)
    cost_of_choice: float = _is(
        2.0, "BIC per ln(tried)", "cost of choosing the best of the effects tried", "Bonferroni's bound"
    )
    wandering_fall: float = _is(
        12.0,
        "BIC",
        "additional fall while the noise still wanders",
        f"{_SIMULATED}: 2 of 85 clean sets came to 17 and 19",
    )
    several_fall: float = _is(
        92.0,
        "BIC",
        "fall that each of several effects must bring",
        f"{_SIMULATED}: imitations 21 to 85, true pairs 100",
    )
    most_effects: int = _is(3, "effects", "most that may join at once", "three fit almost anything smooth")
    least_lead: float = _is(6.0, "BIC", "lead below which the runner-up is also named", "Kass and Raftery: strong")
    same_end: float = _is(1.0, "BIC", "difference below which two fits are equally good", _SIMULATED)
    nearly: float = _is(20.0, "BIC", "most behind the best for a candidate that is still tested", _SIMULATED)
    stands_out: float = _is(5.0, "noise norms", "size of a single effect given all other parameters", "five sigma")
    one_of_two: float = _is(12.0, "noise norms", "size of each of two effects", f"{_SIMULATED}: faint pairs imitate")
    one_of_three: float = _is(
        30.0,
        "noise norms",
        "size of each of three effects",
        f"{_SIMULATED}: a slipping clamp looked like three of 18 to 26",
    )
    separation: float = _is(
        5.0, "noise norms", "size that remains given a look-alike, SNR sqrt(1 - cos^2)", "five sigma"
    )
    undetermined: int = _is(5, "look-alikes", "most that an effect whose form is determined may have", _CONVENTION)
    further_off: float = _is(1.02, "ratio", "largest validation rms after, over that before", _SIMULATED)
    clear_of_rest: float = _is(2.0, "ratio", "least size of an effect over that of the residual", _CONVENTION)
    clear_of_misfit: float = _is(
        100.0, "ratio", "the same if several effects join or a misfit remains", "a law right to a hundredth"
    )
    freedom_chance: float = _is(3e-3, "probability", "that a correct fit uses any freedom", "three sigma")
    shape_chance: float = _is(1e-3, "probability", "that noise has a shape common to all shots", _CONVENTION)
    wandering_gain: float = _is(3.0, "ratio", "increase of chance gains if the noise wanders", _SIMULATED)
    small_sample: float = _is(
        1.35, "ratio", "of a common shape's quantiles to those of chi^2", "bootstrap of 3 shots of 60 ms"
    )
    own_flights: float = _is(
        0.05,
        "probability",
        "that common laws fit the flights; below it, accelerations per flight are tried",
        _CONVENTION,
    )
    rough_correlation: float = _is(0.15, "1", "autocorrelation above which a residual is not noise", _SIMULATED)
    rough_ratio: float = _is(
        2.5, "ratio", "of power, strongest to weakest phase, above which it is not noise", _SIMULATED
    )
    law_fall: float = _is(28.0, "BIC", "fall for a law to be learned from the shots", "as an effect among ten thousand")
    form_excluded: float = _is(10.0, "BIC", "behind the best form: from here on the shots exclude a form", _KASS)
    form_meets: float = _is(12.0, "BIC", "behind the free curve: from here on a form is not the law", _KASS)
    site_nm: float = _is(
        20.0, "nm", "rms of random motion above which it may be a building's",
        "a quiet bench whose path wanders: 14; VC-G, two rigs: 23 to 150",
    )  # fmt: skip
    drawn_far: float = _is(
        1e6, "chi^2 per sample", "of an unconverged base fit, above which the search starts from readings", _SIMULATED
    )
    drive_gain: float = _is(
        0.02, "ratio", "of a drive: fall of the force error of prediction that each law must bring", _DRIVES
    )
    drive_same: float = _is(
        0.35, "ratio", "of a drive: largest difference of a law's force between the halves of the records", _DRIVES
    )
    drive_laws: int = _is(5, "laws", "of a drive: most that may join", _CONVENTION)
    drive_explained: float = _is(
        1.5, "ratio", "of a drive: residual over repeatability, up to which it counts as explained", _CONVENTION
    )

    def fall(self, tried: int, *, wandering: bool = False) -> float:
        """Return by how much the best of ``tried`` effects must lower the BIC to join."""
        return self.least_fall + self.cost_of_choice * math.log(max(tried, 1)) + self.wandering_fall * wandering

    def size_of_one(self, of: int) -> float:
        """Return the size in noise norms that each of ``of`` effects must have."""
        return (self.stands_out, self.one_of_two, self.one_of_three)[min(max(of, 1), 3) - 1]


CRITERIA = Criteria()


def may_beat(beat: float, there: float, start: float, rounds: int = 1) -> bool:
    """Return whether a search that lowered the BIC from ``start`` to ``there`` may still come below ``beat``.

    Each of the following ``rounds`` is assumed to gain at most as much as all rounds before it together.
    """
    return start - (1 << rounds) * (start - there) < beat
