"""Sets an oscilloscope's time base, memory depth and trigger before a shot."""

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
    """The hardware trigger: ``source`` is a channel, "external", or None for the instrument's own setting."""

    source: int | str | None = None
    slope: str = "rising"
    level_v: float | None = None  # None: as set on the instrument


def set_time(
    dialect: Dialect, write: Write, set_now: Callable[[], CaptureSettings], wanted: CaptureSettings, name: str
) -> None:
    """Set time base, memory depth and trigger delay if they differ from ``wanted``.

    Raises DigitizerError if the instrument then has another rate.
    """
    if set_now() == wanted:
        return
    length_s = wanted.samples / wanted.sample_rate_hz
    per_division = length_s / dialect.divisions
    if dialect.depths:
        per_division = _one_two_five(per_division)
        needed = wanted.sample_rate_hz * per_division * dialect.divisions
        depth = min(dialect.depths, key=lambda candidate: abs(math.log(candidate / needed)))
        write(dialect.set_depth.format(samples=depth, short=_short(depth)))
    write(dialect.set_time_per_division.format(seconds=per_division))
    record_s = per_division * dialect.divisions
    before_s = wanted.pre_trigger_samples / wanted.sample_rate_hz + (record_s - length_s) / 2
    write(dialect.set_trigger_delay.format(seconds=record_s / 2 - before_s))
    now = set_now()
    if abs(now.sample_rate_hz / wanted.sample_rate_hz - 1) > RATE_TOLERANCE:
        raise DigitizerError(
            f"{name} takes {now.sample_rate_hz:g} samples/s at this length, not {wanted.sample_rate_hz:g}",
            f"ask for {now.sample_rate_hz:g}, or set time base and memory depth on the instrument",
        )


def set_trigger(dialect: Dialect, write: Write, trigger: HardwareTrigger) -> None:
    """Set the trigger, unless the instrument's own setting is used."""
    if trigger.source is None:
        return
    external = trigger.source == EXTERNAL
    commands = list(dialect.trigger_external if external else dialect.trigger_channel)
    commands.append(dialect.slope[trigger.slope])
    if trigger.level_v is not None:
        commands.append(dialect.level)
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
