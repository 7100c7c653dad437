"""How shots are to be taken, as the operator chose it, and the usual settings of a digitizer."""

from dataclasses import dataclass
from pathlib import Path

from analysis.shot.recording import Setup
from instrument.capture.trigger import Edge
from instrument.devices.digitizer import CaptureSettings, Digitizer, DigitizerError


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """How shots are to be taken.

    ``settings`` None: see usual_settings; ``setup`` None the rig the digitizer knows.  Thresholds of
    the light switch are in V, None learns them.  ``watch``: signals are read before arming too, where the digitizer
    streams.  Where no channel carries a light switch and the hardware has no trigger, the block itself fires as soon
    as it moves faster than ``trigger_speed_m_per_s``; None leaves it to the operator.  The folder must exist.
    """

    folder: Path
    settings: CaptureSettings | None = None
    setup: Setup | None = None
    edge: Edge = Edge.EITHER
    switch_low_v: float | None = None
    switch_high_v: float | None = None
    trigger_speed_m_per_s: float | None = 0.05
    watch: bool = True
    prefix: str = "shot"


_RATE_HZ = 30e6
_SHOT_S = 1 / 6


def usual_settings(digitizer: Digitizer, rate_hz: float | None = None, samples: int | None = None) -> CaptureSettings:
    """Return the settings for a shot where the operator leaves something open.

    A replay's are its recording's; else the fastest rate up to the paper's 30 MS/s, a sixth of a second (the paper's
    5 M samples), and a sixteenth of the shot before the trigger.  Raises DigitizerError where no rate is known.
    """
    own = digitizer.default_settings()
    able = digitizer.capabilities
    if rate_hz is None:
        rates = [own.sample_rate_hz] if own is not None else sorted(able.rates_hz)
        if not rates:
            raise DigitizerError(f"{able.name} states no sample rate", "give one")
        rate_hz = max((rate for rate in rates if rate <= _RATE_HZ), default=rates[0])
    if samples is None:
        samples = own.samples if own is not None else round(rate_hz * _SHOT_S)
        samples = min(samples, able.max_samples or samples)
    before = own.pre_trigger_samples if own is not None else samples // 16
    return CaptureSettings(rate_hz, samples, min(before, samples))
