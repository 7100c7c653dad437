"""The closed loop on example cases, as a page: ``python -m tests.benchmarks.stories [--page docs/closed-loop.md]``.

This command computes every number of the page; the measured and undeclared data must be in ../shared.
"""

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Diagnosis, Errors
from analysis.diagnosis.findings.wording import in_words
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulation import demodulate
from analysis.signal.record import motion_from_displacement
from instrument.files.law_file import read_law
from instrument.files.motion_file import read_motion
from instrument.files.recording_file import read_recording
from tests.bench.blind import drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind
from tests.law_rigs import LawRig

SHARED = Path(__file__).resolve().parents[3] / "shared"
WIDTH, HEIGHT = 720, 220
TYPED = """\
name = "brake"
words = "eddy currents near the plate"
where = "block"
formula = "-a*exp(x/b)*v"

[parameters.a]
unit = "N s/m"
start = 1e-3
lower = 0

[parameters.b]
unit = "m"
start = 1e-3
lower = 1e-5
"""


def simulated() -> tuple[Motion, ...]:
    """Return three shots of the bench with friction in the bearing, on a building's floor of 0.3 nm."""
    truth = replace(drawn((), 11, Noise(NoiseKind.FLOOR)), effects={"coulomb_friction": {"force_n": 2e-5}})
    return tuple(
        motion_from_displacement(r.time_s, r.displacement_m, None, None, r.moving_mass_kg, 1e-6, 1e4)
        for r in records(truth)
    )


def braked() -> tuple[Motion, ...]:
    """Return three shots of a rig whose block is braked by eddy currents, from the tests' own integrator."""
    rig = LawRig(on_block=lambda x, v, *_: -4e-4 * math.exp(x / 1.2e-3) * v, noise_m=1e-10)
    return tuple(rig.shots())


def typed() -> Diagnosis:
    """Return the diagnosis that tests the law of ``TYPED``, read from a file as a person would have written it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "brake.toml"
        path.write_text(TYPED, encoding="utf-8")
        return diagnose(braked(), laws=[read_law(path)])


def recorded(folder: Path) -> tuple[Motion, ...]:
    """Return the demodulated shots of a folder."""
    return tuple(demodulate(read_recording(path), AnalysisSettings()) for path in sorted(folder.glob("*.sigmf-meta")))


def measured(pattern: str) -> tuple[Motion, ...]:
    """Return the motion records whose names match."""
    out = []
    for path in sorted((SHARED / "measured").glob(pattern)):
        r = read_motion(path)
        out.append(
            motion_from_displacement(
                r.time_s, r.displacement_m, r.velocity_m_per_s, r.force_n, r.moving_mass_kg, r.moving_mass_u_kg or 0.0
            )
        )
    return tuple(out)


def errors_row(what: str, errors: Errors | None) -> str:
    """Return a row of the table of errors."""
    if errors is None:
        return f"| {what} | no validation | | | |"
    numbers = (errors.displacement_rms_m, errors.velocity_rms_m_per_s, errors.force_rms_n, errors.reduced_chi2)
    return f"| {what} | {' | '.join('–' if n != n else f'{n:.4g}' for n in numbers)} |"


def told(title: str, lead: str, found: Diagnosis, image: Path | None, page: Path) -> str:
    """Return one case as Markdown."""
    said = in_words(found)
    lines = [f"## {title}", "", lead, "", f"**{found.verdict.value}**. {said.sentence}", ""]
    for effect in found.effects:
        others = ", ".join(other.name for other in effect.indistinguishable_from)
        others = f"; indistinguishable from {others}" if others else ""
        evidence = ", ".join(f"{key} {value:.3g}" for key, value in effect.evidence.items())
        lines.append(f"- `{effect.name}`: {evidence}{others}")
    for law in found.laws:
        evidence = ", ".join(f"{key} {value:.4g}" for key, value in law.evidence.items())
        reach = f"range covered: {law.visited[0]:.3g} to {law.visited[1]:.3g} {law.curve_unit}"
        hidden = "; ".join(law.not_observable)
        lines.append(f"- a law as a function of {law.argument}: {evidence}; {reach}; not observable: {hidden}")
    lines += ["", "| error | displacement, m | velocity, m/s | force, N | reduced chi² |", "|---|---|---|---|---|"]
    lines += [errors_row("before", found.error_before), errors_row("after", found.error_after)]
    lines += [errors_row("validation, before", found.error_held_out_before)]
    lines += [errors_row("validation, after", found.error_held_out_after), ""]
    ranked = [f"`{c.name}` {c.delta_bic:+.0f}" for c in found.candidates[:4] if c.delta_bic is not None]
    lines += [f"Candidates tried, with the change of the criterion (BIC): {', '.join(ranked)}.", ""]
    if said.separating_shot:
        lines += [f"Shot that would separate look-alikes: {said.separating_shot}.", ""]
    if said.remainder:
        lines += [f"After the diagnosis: {said.remainder}.", ""]
    if image is not None:
        lines += [f"![residual before and after]({image.relative_to(page.parent)})", ""]
    return "\n".join(lines)


def drawing(found: Diagnosis) -> str:
    """Return the displacement residual of every shot, before (grey) and after (blue), as SVG."""
    pieces = []
    most = 1e-12
    for fit in (found.fit_before, found.fit_after):
        for shot in fit.shots:
            most = max(most, float(np.nanmax(np.abs(shot.residual_m), initial=0.0)))
    for fit, colour in ((found.fit_before, "#999"), (found.fit_after, "#1668b8")):
        for shot in fit.shots:
            t, r = shot.overlay.time_s, shot.residual_m
            good = np.flatnonzero(np.isfinite(r))
            good = good[:: max(1, good.size // 700)]
            x = WIDTH * (t[good] - t[0]) / (t[-1] - t[0])
            y = HEIGHT / 2 - 0.48 * HEIGHT * r[good] / most
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
            pieces.append(f'<polyline fill="none" stroke="{colour}" stroke-width="0.8" points="{points}"/>')
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}">'
    label = f'<text x="6" y="14" font-size="12">± {most * 1e9:.3g} nm; grey before, blue after</text>'
    return "\n".join([head, *pieces, label, "</svg>"]) + "\n"


def stories() -> Sequence[tuple[str, str, str, Diagnosis]]:
    """Return (title, image name or nothing, lead, diagnosis) of every case whose data are available."""
    out = [
        (
            "A simulated rig with friction",
            "closed-loop-simulated.svg",
            "The bench shares no code with the analysis. It had 20 µN of dry friction and 0.3 nm of building motion.",
            diagnose(simulated()),
        )
    ]
    for number in range(1, 5):
        folder = SHARED / "recordings" / f"undeclared-{number}"
        if folder.is_dir():
            name = f"closed-loop-undeclared-{number}.svg"
            lead = "Raw recordings of a rig with an undeclared effect."
            out.append((f"Undeclared set {number}", name, lead, diagnose(recorded(folder))))
    lead = (
        "Eddy currents brake the block. Their coefficient, 0.4 mN s/m at the plate, falls by a factor e every 1.2 mm. "
        f"The operator suspects this, writes `brake.toml`:\n\n```toml\n{TYPED}```\n\n"
        "and calls `levimass replay shots --law brake.toml`."
    )
    out.append(("A law typed by hand", "closed-loop-typed.svg", lead, typed()))
    if (SHARED / "measured").is_dir():
        lead = "EMPS, a driven slider (Janot, Gautier, Brunot 2019); base: mass, viscous drag, offset."
        out.append(("A measured drive", "", lead, diagnose(measured("emps.csv"), model="driven")))
        lead = "Five collisions on an air track, fitted jointly on spring and dashpot; each predicted from the others."
        found = diagnose(measured("airtrack-*.csv"), model="contact")
        out.append(("Measured collisions", "closed-loop-airtrack.svg", lead, found))
    return out


def main(arguments: list[str] | None = None) -> int:
    """Print the diagnosis of every case; write page and figures if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--page", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    page = options.page or Path("docs/closed-loop.md")
    parts = [
        "# The closed loop on example cases",
        "",
        "Written by `python -m tests.benchmarks.stories --page docs/closed-loop.md`; every number is computed by it.",
        "`analysis/paper/paper_audit.py` gives the paper's numbers before and after, and the cause of each difference.",
        "Statistics on blind sets are in [closed-loop-benchmark.md](closed-loop-benchmark.md) (`make bench-loop`).",
        "",
    ]
    for title, name, lead, found in stories():
        image = page.parent / "images" / name if name else None
        if options.page and image is not None:
            image.parent.mkdir(parents=True, exist_ok=True)
            image.write_text(drawing(found), encoding="utf-8")
        parts.append(told(title, lead, found, image, page))
        print(f"{title}: {found.verdict.value}: {found.sentence} ({found.seconds:.1f} s)", flush=True)
    if options.page:
        page.write_text("\n".join(parts), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
