"""What is set on an oscilloscope before a shot: time base and memory depth, and what fires it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.scpi_dialects import Dialect

EXTERNAL = "external"
RATE_TOLERANCE = 1e-3

Write = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class HardwareTrigger:
    """What starts a shot: ``source`` a channel, "external", or None for what is set on the instrument."""

    source: int | str | None = None
    slope: str = "rising"
    level_v: float | None = None  # None: as set on the instrument


def set_time(
    words: Dialect, write: Write, set_now: Callable[[], CaptureSettings], wanted: CaptureSettings, name: str
) -> None:
    """Set time base, memory depth and trigger delay where they are not as wanted.

    Raises DigitizerError where the instrument then takes another rate.
    """
    if set_now() == wanted:
        return
    length_s = wanted.samples / wanted.sample_rate_hz
    per_division = length_s / words.divisions
    if words.depths:
        per_division = _one_two_five(per_division)
        needed = wanted.sample_rate_hz * per_division * words.divisions
        depth = min(words.depths, key=lambda candidate: abs(math.log(candidate / needed)))
        write(words.set_depth.format(samples=depth, short=_short(depth)))
    write(words.set_time_per_division.format(seconds=per_division))
    record_s = per_division * words.divisions
    before_s = wanted.pre_trigger_samples / wanted.sample_rate_hz + (record_s - length_s) / 2
    write(words.set_trigger_delay.format(seconds=record_s / 2 - before_s))
    now = set_now()
    if abs(now.sample_rate_hz / wanted.sample_rate_hz - 1) > RATE_TOLERANCE:
        raise DigitizerError(
            f"{name} takes {now.sample_rate_hz:g} samples/s at this length, not {wanted.sample_rate_hz:g}",
            f"ask for {now.sample_rate_hz:g}, or set time base and memory depth on the instrument",
        )


def set_trigger(words: Dialect, write: Write, trigger: HardwareTrigger) -> None:
    """Set what fires a shot; nothing where it is taken as set on the instrument."""
    if trigger.source is None:
        return
    external = trigger.source == EXTERNAL
    commands = list(words.trigger_external if external else words.trigger_channel)
    commands.append(words.slope[trigger.slope])
    if trigger.level_v is not None:
        commands.append(words.level)
    for command in commands:
        source = "EX" if external else f"C{trigger.source}"
        write(command.format(n=trigger.source, source=source, volts=trigger.level_v))


def _one_two_five(value: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not below ``value``."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1, 2, 5, 10) if m * power >= value * (1 - 1e-9))


def _short(samples: int) -> str:
    """Return a memory depth as Siglent writes it: 7K, 70K, 700K, 7M."""
    return f"{samples // 1_000_000}M" if samples >= 1_000_000 else f"{samples // 1000}K"
