"""The outcomes of the coverage benchmark as Markdown: coverage, numbers that are off without a word, and sharpness."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.shot.consistency import flags_affecting
from tests.benchmarks.coverage_shots import CONDITIONS, SITES

BEGIN, END = "<!-- coverage: begin -->", "<!-- coverage: end -->"
K_95 = 1.96
FAR = 5.0  # standard uncertainties: the worst that an instrument can do without a word
SCATTER = (0.95, 1.05)  # over the stated uncertainty, asked of every number
ALL = "all"  # sites
FEWEST = 10  # readings of which a scatter is told
# that the site shakes is no excuse, since a number's uncertainty claims to hold that
NO_EXCUSE = ("vibration",)

Outcome = dict[str, Any]
Read = tuple[float, float, float]


def tables(outcomes: Sequence[Outcome], seed: int) -> str:
    """Return the three tables of ``outcomes``."""
    names = list(dict.fromkeys(name for outcome in outcomes for name in outcome["read"]))
    parts = [f"{len(outcomes)} shots of seed {seed} (`python -m tests.benchmarks.coverage`).", ""]
    parts += ["Share of 95 % intervals that contain the true value (number of intervals):", ""]
    parts += _grid("number", SITES, names, lambda name, site: _held(_reads(outcomes, name, "site", site)))
    least, most = SCATTER
    required = f"required: {least:g} to {most:g}, bold where outside by over two standard errors"
    parts += ["", f"Rms error of plain shots over their stated standard uncertainty; {required}:", ""]
    plain = [outcome for outcome in outcomes if outcome["condition"] == "plain"]
    parts += _grid("number", (*SITES, ALL), names, lambda name, site: _scatter(_reads(plain, name, "site", site)))
    far = f"Share of numbers off by more than {FAR:g} standard uncertainties"
    parts += ["", f"{far}, then the share off by as much without a flag for it:", ""]
    parts += [*_grid("number", CONDITIONS, names, lambda name, what: _far(outcomes, name, what))]
    sharp = "Median of stated over least possible standard uncertainty, and share of shots whose reading was refused"
    parts += ["", f"{sharp}:", ""]
    numbers = list(outcomes[0]["bound"])
    parts += _grid("number", SITES, numbers, lambda name, site: _sharp(outcomes, name, site, "bound"))
    bent = [outcome for outcome in outcomes if "bent" in outcome]
    same = "The same with a bound that allows each flight its own acceleration of 1 mm/s², as the reading does"
    parts += ["", f"{same}:", ""]
    parts += _grid("number", SITES, numbers, lambda name, site: _sharp(bent, name, site, "bent"))
    return "\n".join(parts)


def into_page(page: Path, text: str) -> None:
    """Put the tables between the page's marks.  Raises ValueError where it has none."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"{page} has no {BEGIN} and {END}")
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")


def faults(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one line for each number that is far off without a flag that says so, worst first."""
    found = []
    for outcome in outcomes:
        for name, read in outcome["read"].items():
            if read is not None and _off(read) > FAR and not excused(outcome, name):
                where = f"{outcome['index']:5d} {outcome['site']} {outcome['condition']:9s}"
                words = f"{name:32s} {read[0]:.6g} ± {read[1]:.2g}, true {read[2]:.6g}; flags {outcome['flags']}"
                found.append((_off(read), f"{_off(read):8.1f} sigma  {where} {words}"))
    return [line for _, line in sorted(found, reverse=True)]


def excused(outcome: Outcome, name: str) -> bool:
    """Return whether a flag that is about this number tells that it cannot be trusted."""
    said = flags_affecting(name.removeprefix("fit."), tuple(outcome["flags"]))
    return any(flag not in NO_EXCUSE for flag in said)


def _off(read: Read | list[float]) -> float:
    return abs(read[0] - read[2]) / read[1] if read[1] > 0 else float("inf")


def _reads(outcomes: Iterable[Outcome], name: str, key: str, value: str) -> list[list[float]]:
    found = [outcome["read"].get(name) for outcome in outcomes if value in (outcome[key], ALL)]
    return [read for read in found if read is not None]


def _held(reads: list[list[float]]) -> str:
    if not reads:
        return "–"
    return f"{100 * np.mean([_off(read) <= K_95 for read in reads]):.0f} % ({len(reads)})"


def _scatter(reads: list[list[float]]) -> str:
    """Return the rms of what numbers are off by, in their uncertainties, with the std that it has by chance."""
    if len(reads) < FEWEST:
        return "–"
    squares = np.array([_off(read) for read in reads]) ** 2
    rms = float(np.sqrt(squares.mean()))
    std = float(squares.std(ddof=1)) / (2.0 * rms * np.sqrt(len(reads)))
    outside = rms + 2.0 * std < SCATTER[0] or rms - 2.0 * std > SCATTER[1]
    return f"**{rms:.2f} ± {std:.2f}**" if outside else f"{rms:.2f} ± {std:.2f}"


def _far(outcomes: Sequence[Outcome], name: str, condition: str) -> str:
    at = [outcome for outcome in outcomes if outcome["condition"] == condition and outcome["read"].get(name)]
    if not at:
        return "–"
    far = [outcome for outcome in at if _off(outcome["read"][name]) > FAR]
    unsaid = [outcome for outcome in far if not excused(outcome, name)]
    return f"{100 * len(far) / len(at):.1f} %, {100 * len(unsaid) / len(at):.1f} %"


def _sharp(outcomes: Sequence[Outcome], name: str, site: str, least: str) -> str:
    at = [outcome for outcome in outcomes if outcome["site"] == site]
    ratios = [o["read"][name][1] / o[least][name] for o in at if o["read"].get(name)]
    if not ratios:
        return "–"
    return f"{np.median(ratios):.2f}, {100 * (1 - len(ratios) / len(at)):.0f} %"


def _grid(corner: str, columns: Sequence[str], rows: Sequence[str], cell: Callable[[str, str], str]) -> list[str]:
    head = [f"| {corner} | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    return [*head, *(f"| {row} | {' | '.join(cell(row, column) for column in columns)} |" for row in rows)]
