"""``levimass acquire``: arm, wait for the light switch, record; ``levimass simulate``: write simulated recordings."""

import sys
from dataclasses import dataclass
from pathlib import Path

from instrument.bench.effects import parse
from instrument.bench.simulate import simulate as write_simulated
from instrument.bench.site import QUIET, site_named
from instrument.capture.acquire import AcquireError
from instrument.capture.acquire import acquire as record
from instrument.devices.digitizer import CaptureSettings, Digitizer, DigitizerError
from instrument.files.recording_error import RecordingError
from instrument.process.subprocess_digitizer import open_in_subprocess

SHOT_S = 0.06  # default length: the contact of some 30 ms with free flight on both sides
LEAST_ARMING_S = 10.0  # firmware is loaded and the device comes back under another name
BEFORE_SWITCH = 0.15  # of it lies before the light switch


@dataclass(frozen=True, slots=True)
class Taking:
    """Where shots come from and go to; ``rate_hz`` and ``samples`` are those of the first set."""

    source: str
    out: Path
    rate_hz: float | None
    samples: int | None
    timeout_s: float


def acquire(shots: int, taking: Taking) -> int:
    """Record ``shots`` shots; print each recording's path; return the exit status."""
    saved: list[Path] = []
    try:
        digitizer = open_in_subprocess(taking.source, arm_s=max(taking.timeout_s, LEAST_ARMING_S))
        settings = capture_settings(digitizer, taking.rate_hz, taking.samples)
        saved = record(digitizer, taking.out, shots, settings, taking.timeout_s, report=_say)
    except AcquireError as error:
        saved = error.saved
        print(f"levimass: {error}", file=sys.stderr)
    except (DigitizerError, RecordingError) as error:
        print(f"levimass: {error}", file=sys.stderr)
    for path in saved:
        print(path)
    return 0 if len(saved) == shots else 1


def capture_settings(digitizer: Digitizer, rate_hz: float | None, samples: int | None) -> CaptureSettings | None:
    """Return what was asked for; None leaves everything to a digitizer that knows (replay)."""
    rates = digitizer.capabilities.rates_hz
    if rate_hz is None and samples is None and len(rates) < 2:
        return None
    rate = rate_hz if rate_hz is not None else (rates[0] if rates else 10e6)
    length = samples if samples is not None else round(SHOT_S * rate)
    return CaptureSettings(rate, length, round(BEFORE_SWITCH * length))


def _say(line: str) -> None:
    print(f"levimass: {line}", file=sys.stderr)


def simulate(
    folder: Path, *, shots: int, seed: int, effect: str | None, undeclared: bool, site: str | None = None
) -> int:
    """Write the recordings, of a quiet bench where no ``site`` is named, and print their paths; return the status."""
    try:
        effects = parse(effect) if effect else None
    except ValueError as error:
        print(f"levimass: --effect: {error}", file=sys.stderr)
        return 2
    try:
        place = site_named(site) if site is not None else QUIET
    except ValueError as error:
        print(f"levimass: --site: {error}", file=sys.stderr)
        return 2
    try:
        paths = write_simulated(folder, shots, seed, effects, undeclared, site=place)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"levimass: {error.filename or folder}: {error.strerror or error}", file=sys.stderr)
        return 1
    for path in paths:
        print(path)
    return 0
