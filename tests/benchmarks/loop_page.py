"""The page that publishes the closed loop's scores: figures, confusion matrix, misses."""

from collections import Counter
from collections.abc import Sequence

from instrument.bench.effects import CATALOGUE, OFF_CATALOGUE
from tests.benchmarks.loop_cases import APART, MIN_SNR, Outcome
from tests.benchmarks.loop_score import exact, lines, named_alone, named_at_all, share, truth_reported


def confusion(outcomes: Sequence[Outcome]) -> tuple[list[str], list[str], list[list[int]]]:
    """Return rows (truth), columns (said) and counts; pairs and raw sets are left out."""
    columns = [*CATALOGUE, "several", "class", "unexplained", "adequate", "failed"]
    rows = ["nothing", *CATALOGUE, *OFF_CATALOGUE]
    counts: dict[str, Counter[str]] = {row: Counter() for row in rows}
    for outcome in outcomes:
        if outcome.case.kind in ("clean", "single", "natural", "beyond"):
            counts[outcome.case.names[0] if outcome.case.names else "nothing"][_said(outcome)] += 1
    return rows, columns, [[counts[row][column] for column in columns] for row in rows]


def _said(outcome: Outcome) -> str:
    if outcome.verdict == "failed":
        return "failed"
    if len(outcome.named) > 1:
        return "several"
    if outcome.named:
        return "class" if any(outcome.classes) else outcome.named[0]
    return "adequate" if outcome.verdict == "adequate" else "unexplained"


def page(outcomes: Sequence[Outcome], command: str) -> str:
    """Return the page for docs/: figures, confusion matrix, misses."""
    head = (
        "# The closed loop, scored blind\n\n"
        f"Regenerate with `{command}`. Each set has three shots at different speeds from the simulated bench, which "
        "shares no code with the analysis. The signal-to-noise ratio (SNR) of an effect is the norm of the residual "
        "that the best base fit leaves in the noise-free set, in units of the noise of one sample. Figures are for "
        f"SNR >= {MIN_SNR:g} unless stated otherwise. An effect can be distinguished if the nearest other effect of "
        "the catalogue, fitted as its best imitation with the base parameters free, leaves a residual of at least "
        f"{APART:g} noise norms. Two effects are each seen beside the other if that residual is at least "
        f"{MIN_SNR:g} for either. Intervals are Wilson's at 95 %. Other runs and the causes of misses are listed in "
        "[the closed loop on other seeds](closed-loop-seeds.md).\n\n"
    )
    table = ["| figure | measured | target | met |", "|---|---|---|---|"]
    marks = {True: "yes", False: "**no**", None: ""}
    table += [f"| {line.what} | {line.figure} | {line.target} | {marks[line.met]} |" for line in lines(outcomes)]
    return head + "\n".join(table) + "\n\n" + _matrix(outcomes) + _by_strength(outcomes) + _misses(outcomes)


def _matrix(outcomes: Sequence[Outcome]) -> str:
    rows, columns, counts = confusion(outcomes)
    number = {name: str(i + 1) for i, name in enumerate(CATALOGUE)}
    text = ["## Confusion matrix\n", "Rows are what was true, columns what was said (numbers as in the rows).\n"]
    text.append("| | true | " + " | ".join(number.get(c, c) for c in columns) + " |")
    text.append("|---" * (len(columns) + 2) + "|")
    for row, line in zip(rows, counts, strict=True):
        if any(line):
            cells = " | ".join(str(n) if n else "" for n in line)
            text.append(f"| {number.get(row, '')} | {row} | {cells} |")
    return "\n".join(text) + "\n\n"


def _by_strength(outcomes: Sequence[Outcome]) -> str:
    text = ["## By strength (one effect)\n", "| asked SNR | exact | true one reported |", "|---|---|---|"]
    single = [o for o in outcomes if o.case.kind == "single" and o.snr >= MIN_SNR]
    for snr in sorted({o.case.snr for o in single}):
        some = [o for o in single if o.case.snr == snr]
        text.append(f"| {snr:g} | {share(some, exact)} | {share(some, truth_reported)} |")
    weak = [o for o in outcomes if o.case.kind == "single" and o.snr < MIN_SNR]
    if weak:
        names = ", ".join(sorted({o.case.names[0] for o in weak}))
        text.append(f"\n{len(weak)} sets could not be made as strong as {MIN_SNR:g} and are not scored: {names}.")
    return "\n".join(text) + "\n\n"


def _misses(outcomes: Sequence[Outcome]) -> str:
    text = ["## Misses\n", "| kind | true | SNR | noise | seed | said | nearest look-alike |", "|---" * 7 + "|"]
    for o in outcomes:
        bad = {
            "clean": named_at_all(o),
            "single": o.snr >= MIN_SNR and not exact(o),
            "natural": o.snr >= MIN_SNR and not exact(o),
            "pair": o.snr >= MIN_SNR and not exact(o),
            "beyond": named_alone(o),
            "raw": not truth_reported(o) or (not o.case.names and named_at_all(o)),
        }[o.case.kind]
        if bad or o.verdict == "failed":
            said = "; ".join(
                name + (f" (or {', '.join(others)})" if others else "")
                for name, others in zip(o.named, o.classes, strict=True)
            )
            where = o.case.raw or o.case.noise
            true = " + ".join(o.case.names) or "nothing"
            said = said or o.problem or o.verdict
            near = f"{o.nearest} {o.apart:.1f}" if o.apart is not None else ""
            text.append(f"| {o.case.kind} | {true} | {o.snr:.0f} | {where} | {o.case.seed} | {said} | {near} |")
    return "\n".join(text) + "\n"
