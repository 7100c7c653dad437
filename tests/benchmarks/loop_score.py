"""Scores of the closed loop, with the bounds that so few runs allow."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tests.benchmarks.loop_cases import APART, MIN_SNR, RAW, Outcome

_Z95 = 1.959964
_ENOUGH = 50


Judged = TypeVar("Judged")  # an outcome of any benchmark


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many, with the Wilson bounds at 95 %."""

    hits: int
    runs: int

    @property
    def value(self) -> float:
        """Get the share, nan where nothing was run."""
        return self.hits / self.runs if self.runs else math.nan

    @property
    def bounds(self) -> tuple[float, float]:
        """Get the Wilson interval (Wilson 1927)."""
        if not self.runs:
            return 0.0, 1.0
        n, z, p = self.runs, _Z95, self.value
        centre = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)

    def __str__(self) -> str:
        if not self.runs:
            return "not run"
        low, high = self.bounds
        return f"{self.hits}/{self.runs} = {100 * self.value:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


@dataclass(frozen=True, slots=True)
class Line:
    """One figure against its target; ``met`` None: nothing to judge by."""

    what: str
    figure: str
    target: str
    met: bool | None


def share(outcomes: Iterable[Judged], holds: Callable[[Judged], object]) -> Share:
    """Return how many outcomes ``holds`` is true of."""
    judged = [bool(holds(outcome)) for outcome in outcomes]
    return Share(sum(judged), len(judged))


def exact(outcome: Outcome) -> bool:
    """Return whether just the true effects were named, each alone."""
    return set(outcome.named) == set(outcome.case.names) and not any(outcome.classes)


def truth_reported(outcome: Outcome) -> bool:
    """Return whether every true effect is named, stands in a reported class, or was removed with a flag."""
    return set(outcome.case.names) <= set(outcome.named).union(outcome.removed, *outcome.classes)


def named_alone(outcome: Outcome) -> bool:
    """Return whether some effect was named as if nothing else could be it, and not only as what comes nearest."""
    return outcome.verdict != "partly_explained" and any(not others for others in outcome.classes)


def _learned(outcome: Outcome) -> bool:
    return outcome.verdict == "law_learned"


def _not_named_alone(outcome: Outcome) -> bool:
    return not named_alone(outcome)


def _tellable(outcome: Outcome) -> bool:
    return outcome.apart is not None and outcome.apart >= APART


def _both_seen(outcome: Outcome) -> bool:
    return outcome.apart is not None and outcome.apart >= MIN_SNR


def _no_lone_wrong_name(outcome: Outcome) -> bool:
    pairs = zip(outcome.named, outcome.classes, strict=True)
    return not any(not others and name not in outcome.case.names for name, others in pairs)


def named_at_all(outcome: Outcome) -> bool:
    """Return whether anything was named."""
    return bool(outcome.named)


def lines(outcomes: Sequence[Outcome]) -> list[Line]:
    """Return every figure that the closed loop is held to."""
    result: list[Line] = []
    strong = [o for o in outcomes if o.case.kind == "single" and o.snr >= MIN_SNR]
    pairs = [o for o in outcomes if o.case.kind == "pair" and o.snr >= MIN_SNR]
    beyond = [o for o in outcomes if o.case.kind == "beyond" and o.snr >= MIN_SNR]

    def at_least(what: str, found: Share, value: float, low: float | None = None) -> None:
        target = f">= {100 * value:.0f} %" + (f", lower bound >= {100 * low:.0f} %" if low else "")
        met = found.value >= value and (low is None or found.bounds[0] >= low)
        result.append(Line(what, str(found), target, _if_enough(found, met)))

    def at_most(what: str, found: Share, value: float) -> None:
        met = _if_enough(found, found.value <= value)
        result.append(Line(what, str(found), f"<= {100 * value:.0f} %", met))

    at_least("one effect, exact name", share(strong, exact), 0.95, 0.90)
    tellable = [o for o in strong if _tellable(o)]
    at_least("one effect, exact name, where it can be told", share(tellable, exact), 0.95, 0.90)
    alike = [o for o in strong if not _tellable(o)]
    at_least("one effect, look-alike too near: no lone wrong name", share(alike, _no_lone_wrong_name), 0.99)
    at_least("one effect, true one reported", share(strong, truth_reported), 0.99)
    both = [o for o in pairs if _both_seen(o)]
    at_least("two effects, each seen beside the other, reported", share(both, truth_reported), 0.99)
    at_least("two effects, true ones reported", share(pairs, truth_reported), 0.99)
    result.append(Line("two effects, both exact", str(share(pairs, exact)), "shown", None))
    for noise in sorted({o.case.noise for o in outcomes if o.case.kind == "clean"}):
        quiet = [o for o in outcomes if o.case.kind == "clean" and o.case.noise == noise]
        at_most(f"clean, {noise} noise, false name", share(quiet, named_at_all), 0.01)
        at_most(f"clean, {noise} noise, a law learned", share(quiet, _learned), 0.01)
        calm = share(quiet, lambda o: o.verdict == "adequate")
        result.append(Line(f"clean, {noise} noise, called adequate", str(calm), "shown", None))
    strange = [o for o in beyond if _tellable(o)]
    at_least("off the catalogue, no single name, where it can be told", share(strange, _not_named_alone), 0.99)
    at_least("off the catalogue, no single name", share(beyond, _not_named_alone), 0.99)
    natural = [o for o in outcomes if o.case.kind == "natural" and o.snr >= MIN_SNR]
    result.append(Line("one effect of natural size, exact name", str(share(natural, exact)), "shown", None))
    result.append(Line("one effect of natural size, reported", str(share(natural, truth_reported)), "shown", None))
    for raw in RAW:
        some = [o for o in outcomes if o.case.kind == "raw" and o.case.raw == raw]
        result.append(Line(f"from counts, {raw}, true one reported", str(share(some, truth_reported)), "shown", None))
        result.append(Line(f"from counts, {raw}, exact", str(share(some, exact)), "shown", None))
    result.extend(_parameters([o for o in strong if exact(o)]))
    result.extend(_held_out([o for o in strong if exact(o)]))
    failed = share(outcomes, lambda o: o.verdict == "failed")
    result.append(Line("diagnosis failed", str(failed), "0", failed.hits == 0))
    if outcomes:
        seconds = np.array([o.seconds for o in outcomes if o.verdict != "failed"] or [math.nan])
        figure = f"median {np.median(seconds):.2f} s, 95th percentile {np.quantile(seconds, 0.95):.2f} s"
        result.append(Line("time a set of three", figure, "<= 2 s", bool(np.median(seconds) <= 2.0)))
    return result


def _if_enough(found: Share, met: bool) -> bool | None:
    """Return ``met``, but None for a target that so few runs would meet by luck."""
    return None if not found.runs or (met and found.runs < _ENOUGH) else met


def _parameters(named: Sequence[Outcome]) -> list[Line]:
    covered, over_bound, stated = [], [], []
    for outcome in named:
        for name, bounds in outcome.bound.items():
            for key, bound in bounds.items():
                if bound <= 0.0 or key not in outcome.found.get(name, {}):
                    continue
                value, std = outcome.found[name][key]
                off = value - outcome.truth[name][key]
                covered.append(abs(off) <= _Z95 * std)
                over_bound.append(off / bound)
                stated.append(std / bound)
    if not covered:
        return [Line("parameters", "none to judge", "", None)]
    inside = Share(sum(covered), len(covered))
    # one gross miss would rule a plain rms: the scatter is read from the middle 68 % as well
    rms = float(np.sqrt(np.mean(np.square(over_bound))))
    middle = float(np.quantile(np.abs(over_bound), 0.6827))
    ratio = float(np.median(stated))
    return [
        Line("95 % intervals cover", str(inside), "92 to 98 %", 0.92 <= inside.value <= 0.98),
        Line("error over Cramer-Rao bound, 68 % quantile", f"{middle:.2f}", "0.9 to 1.2", 0.9 <= middle <= 1.2),
        Line("error over Cramer-Rao bound, rms", f"{rms:.2f}", "shown", None),
        Line("stated uncertainty over bound, median", f"{ratio:.2f}", "0.9 to 1.2", 0.9 <= ratio <= 1.2),
    ]


def _held_out(named: Sequence[Outcome]) -> list[Line]:
    ratios = []
    for outcome in named:
        if outcome.held_out is None:
            continue
        before, after = (rms**2 - outcome.noise_m**2 for rms in outcome.held_out)
        if before > 0.2 * outcome.noise_m**2:  # below, the excess itself drowns in the noise
            ratios.append(after / before)
    if not ratios:
        return [Line("held-out excess error, after / before", "none to judge", "<= 0.05", None)]
    middle = float(np.median(ratios))
    figure = f"median {middle:.4f}, 90 % below {np.quantile(ratios, 0.9):.4f}, {len(ratios)} sets"
    return [Line("held-out excess error, after / before", figure, "<= 0.05", middle <= 0.05)]
