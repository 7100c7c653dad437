"""``levimass acquire``: record shots from a digitizer; ``levimass simulate``: write simulated recordings."""

from dataclasses import dataclass
from pathlib import Path

from app.command_line.options import USAGE
from app.command_line.outputs import error_line, say
from instrument.bench import QUIET, parse, site_named
from instrument.bench import simulate as write_simulated
from instrument.capture import AcquireError
from instrument.capture import acquire as record
from instrument.devices import CaptureSettings, Digitizer, DigitizerError
from instrument.files import RecordingError
from instrument.process import open_in_subprocess

SHOT_S = 0.06  # default length: a contact of 30 ms with free flight on both sides
MIN_ARMING_S = 10.0  # a device may first load firmware and reconnect under another name
BEFORE_SWITCH = 0.15  # fraction of the samples recorded before the light switch


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """Source and folder of the shots; ``rate_hz`` and ``samples`` apply to unplanned shots."""

    source: str
    out: Path
    rate_hz: float | None
    samples: int | None
    timeout_s: float


def acquire(shots: int, request: CaptureRequest) -> int:
    """Record this number of shots; print each recording's path; return the exit status."""
    saved: list[Path] = []
    try:
        saved = record_shots(shots, request)
    except AcquireError as error:
        saved = error.saved
        say(error)
    except (DigitizerError, RecordingError) as error:
        say(error)
    for path in saved:
        print(path)
    return 0 if len(saved) == shots else 1


def record_shots(count: int, request: CaptureRequest) -> list[Path]:
    """Record unplanned shots and return their paths.

    Raises AcquireError, DigitizerError and RecordingError.
    """
    digitizer = opened(request.source, request)
    settings = capture_settings(digitizer, request.rate_hz, request.samples)
    return record(digitizer, request.out, count, settings, request.timeout_s, report=say)


def opened(source: str, request: CaptureRequest) -> Digitizer:
    """Open a digitizer in a subprocess, with time to arm as long as requested.  Raises DigitizerError."""
    return open_in_subprocess(source, arm_s=max(request.timeout_s, MIN_ARMING_S))


def capture_settings(digitizer: Digitizer, rate_hz: float | None, samples: int | None) -> CaptureSettings | None:
    """Return sample rate and length of a shot; None for a source with its own settings, such as a replay."""
    rates = digitizer.capabilities.rates_hz
    if rate_hz is None and samples is None and len(rates) < 2:
        return None
    rate = rate_hz if rate_hz is not None else (rates[0] if rates else 10e6)
    length = samples if samples is not None else round(SHOT_S * rate)
    return CaptureSettings(rate, length, round(BEFORE_SWITCH * length))


def simulate(
    folder: Path, *, shots: int, seed: int, effect: str | None, undeclared: bool, site: str | None = None
) -> int:
    """Write simulated recordings and print their paths; return the exit status.  ``site`` None: a quiet bench."""
    try:
        effects = parse(effect) if effect else None
    except ValueError as error:
        say(f"--effect: {error}")
        return USAGE
    place = site_named(site) if site is not None else QUIET  # the parser has checked the name
    try:
        paths = write_simulated(folder, shots, seed, effects, undeclared, site=place)
    except (RecordingError, OSError) as error:
        say(error_line(error, folder))
        return 1
    for path in paths:
        print(path)
    return 0
