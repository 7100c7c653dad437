"""How shots are to be taken, as the operator chose it, and which settings no shot can be taken with."""

from dataclasses import dataclass
from pathlib import Path

from analysis.shot import Setup
from instrument.devices import Capabilities, CaptureSettings, DigitizerError
from instrument.trigger import Edge

MOST_SHOT_BYTES = 2 * 2**30


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """How shots are to be taken.  The folder must exist.

    ``settings`` None: ``usual_settings`` of the digitizer; ``setup`` None: the digitizer's own.  The thresholds of the
    light switch are in V; None: learned from the signal.
    """

    folder: Path
    settings: CaptureSettings | None = None
    setup: Setup | None = None
    edge: Edge = Edge.EITHER
    switch_low_v: float | None = None
    switch_high_v: float | None = None


def check_settings(settings: CaptureSettings, channels: int) -> None:
    """Refuse, as a DigitizerError, settings that no shot can be taken with."""
    rate = settings.sample_rate_hz
    if not (0 < rate <= 1e12):
        raise DigitizerError(f"sample rate of {rate:g} Hz", "choose one of the digitizer's rates")
    if settings.samples < 1 or not 0 <= settings.pre_trigger_samples <= settings.samples:
        raise DigitizerError(
            f"a shot of {settings.samples} samples, {settings.pre_trigger_samples} of them before the trigger",
            "correct the lengths",
        )
    if 2 * channels * settings.samples > MOST_SHOT_BYTES:
        raise DigitizerError(
            f"a shot of {settings.samples} samples in {channels} channels takes more than "
            f"{MOST_SHOT_BYTES // 2**30} GiB of memory",
            "choose a shorter shot or a lower rate",
        )


def check_channels(able: Capabilities) -> None:
    """Refuse, as a DigitizerError, channels whose scale no recording can hold."""
    for channel in able.channels:
        if not (1e-30 < abs(channel.volts_per_count) < 1e6 and abs(channel.offset_v) < 1e9):
            raise DigitizerError(
                f"{able.name} reports {channel.volts_per_count:g} V per count and an offset of {channel.offset_v:g} V",
                "set the vertical scale anew, then arm again",
            )
