"""Checks of the signals at rest: each beat is there, strong and unclipped; the light switch toggles.

The window judges the running stream, in the set-up and in the signal line; ``try_signals`` works without a screen.
"""

import time
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.reading import SiteFloor
from analysis.shot import Channel, Role
from instrument.devices import Check, Digitizer, DigitizerError, Grade, usual_settings
from instrument.live.live_view import ChannelSignal
from instrument.process import SIMULATED_ANSWER_S
from instrument.trigger import LightSwitch, TriggerSettings

CHANNEL_NAMES = {Role.REFERENCE: "PD0", Role.MEASUREMENT: "PD1", Role.SWITCH: "light switch"}
WEAK_SNR_DB = 15.0  # below, phase noise makes single cycles slip
SMALL_SHARE = 0.05  # of the range: below, the converter's steps dominate the noise
CLIPPED_SHARE = 0.01
NYQUIST_SHARE = 0.4
MOVING_HZ = 20e3  # a block held by hand shifts the beat by less
WATCHED_S = 3.0  # time to pass the block through the light switch by hand
TRIGGER_WAIT_S = 20.0
_BLOCK = 1 << 17
_TIMEOUT_S = 0.05
_EARLIER_LOOKS = 4  # measurements kept before the newest one


def judge(
    signals: Sequence[ChannelSignal], sample_rate_hz: float, toggles: int, rest_frequency_hz: float | None = None
) -> tuple[Check, ...]:
    """Judge the signal of each channel of an armed rig at rest; ``toggles`` is how often the light switch changed."""
    checks = [
        _switch(signal, toggles) if signal.role is Role.SWITCH else judge_beat(signal, sample_rate_hz)
        for signal in signals
    ]
    return (*checks, *_rest(signals, rest_frequency_hz))


def judge_site(floor: SiteFloor) -> Check:
    """Judge the vibration of the site: expected uncertainty of the next COR, and the first advice to reduce it."""
    meets = f"meets {floor.criterion}" if floor.criterion else "meets no vibration criterion"
    line = f"{meets}; expected u(COR) {floor.cor_std:.1g}"
    if floor.advice:
        return Check("site", Grade.WARN, f"{line}. {floor.advice[0]}")
    return Check("site", Grade.OK, line)


def judge_beat(signal: ChannelSignal, sample_rate_hz: float) -> Check:
    """Judge one beat at rest."""
    name = CHANNEL_NAMES[signal.role]
    if signal.frequency_hz is None or signal.snr_db is None:
        return Check(name, Grade.FAIL, "no beat above the noise: check laser, alignment and cable")
    share = signal.amplitude_v / signal.range_v
    found = (
        f"beat at {signal.frequency_hz / 1e6:.4f} MHz, {signal.amplitude_v:.3g} V ({100 * share:.0f} % of the range), "
        f"{signal.snr_db:.0f} dB"
    )
    if signal.clipped_fraction > CLIPPED_SHARE:
        clipped = f"clipped in {100 * signal.clipped_fraction:.1f} % of the samples"
        return Check(name, Grade.FAIL, f"{found}; {clipped}: lower the gain or the light")
    problems = []
    if signal.clipped_fraction > 0:
        problems.append("clips now and then: lower the gain a step")
    if signal.snr_db < WEAK_SNR_DB:
        problems.append("weak against the noise: align the beams")
    if share < SMALL_SHARE:
        problems.append("small for this range: raise the gain")
    if signal.frequency_hz > NYQUIST_SHARE * sample_rate_hz:
        problems.append("close to half the sample rate: sample faster")
    if problems:
        return Check(name, Grade.WARN, "; ".join((found, *problems)))
    return Check(name, Grade.OK, found)


def _switch(signal: ChannelSignal, toggles: int) -> Check:
    name = CHANNEL_NAMES[signal.role]
    level = f"at {signal.amplitude_v:.2f} V"
    if not toggles:
        return Check(name, Grade.WARN, f"{level}, has not toggled yet: pass the block through it by hand")
    return Check(name, Grade.OK, f"{level}, toggled {toggles} time{'s' if toggles > 1 else ''}")


def doppler_shift_hz(signals: Sequence[ChannelSignal], rest_frequency_hz: float | None = None) -> float | None:
    """Return how far PD1's beat is from PD0's, without PD0 from ``rest_frequency_hz``; None if a beat is missing."""
    beats = {Role.REFERENCE: rest_frequency_hz} | {signal.role: signal.frequency_hz for signal in signals}
    rest, moving = beats[Role.REFERENCE], beats.get(Role.MEASUREMENT)
    return None if rest is None or moving is None else moving - rest


def _rest(signals: Sequence[ChannelSignal], rest_frequency_hz: float | None) -> list[Check]:
    if rest_frequency_hz is None and all(signal.role is not Role.REFERENCE for signal in signals):
        return [Check("rest frequency", Grade.FAIL, "no channel carries PD0: give the rest frequency")]
    shift_hz = doppler_shift_hz(signals, rest_frequency_hz)
    if shift_hz is None:
        return []
    line = f"PD1 is {shift_hz / 1e3:+z.1f} kHz from the rest frequency"
    if abs(shift_hz) > MOVING_HZ:
        return [Check("rest frequency", Grade.WARN, f"{line}: is the block at rest, and is it PD1 on this channel?")]
    return [Check("rest frequency", Grade.OK, line)]


def try_signals(
    digitizer: Digitizer, seconds: float = WATCHED_S, clock: Callable[[], float] = time.monotonic
) -> tuple[Check, ...]:
    """Check the signals of an opened digitizer, the block at rest.

    A stream is watched for ``seconds`` after its first samples, which must come within the same time; changes of the
    light switch are counted.  A device with a hardware trigger is checked by one shot within TRIGGER_WAIT_S.  Raises
    DigitizerError; stops the digitizer.
    """
    able = digitizer.capabilities
    settings = usual_settings(digitizer)
    channels, bits = able.channels, able.bits
    column = next((n for n, channel in enumerate(channels) if channel.role is Role.SWITCH), None)
    switch = LightSwitch(TriggerSettings(), column, bits) if column is not None else None
    digitizer.arm(settings)
    try:
        looks = _looks(digitizer, switch, seconds, clock)
    finally:
        digitizer.stop()
    rate_hz, rest_hz = settings.sample_rate_hz, digitizer.setup.rest_frequency_hz
    toggles = switch.toggles if switch is not None else 0
    judged = (judge(check_signals(look, channels, rate_hz, bits), rate_hz, toggles, rest_hz) for look in looks)
    latest = next(judged)
    if _all_ok(latest) or any(check.grade is Grade.FAIL for check in latest):
        return latest
    # a block passing the switch is not at rest: use an earlier measurement at rest
    return next(filter(_all_ok, judged), latest)


def _all_ok(checks: Sequence[Check]) -> bool:
    return all(check.grade is Grade.OK for check in checks)


def _looks(
    digitizer: Digitizer, switch: LightSwitch | None, seconds: float, clock: Callable[[], float]
) -> list[NDArray[np.int16]]:
    """Return the last counts of an armed digitizer and some from earlier, the newest first, each (n, channels).

    ``switch`` counts its changes in all samples.  Raises DigitizerError if too few samples come.
    """
    able = digitizer.capabilities
    buffer = np.empty((_BLOCK, len(able.channels)), np.int16)
    newest = np.empty((0, len(able.channels)), np.int16)
    before: deque[NDArray[np.int16]] = deque(maxlen=_EARLIER_LOOKS)
    wait_s = TRIGGER_WAIT_S if able.hardware_trigger else SIMULATED_ANSWER_S if able.simulated else seconds
    end = clock() + wait_s
    look_at = clock()
    ended = False
    while clock() < end and not ended:
        block = digitizer.read_into(buffer, _TIMEOUT_S)
        part = buffer[: block.samples]
        ended = block.ended
        if len(part) and not newest.size and not able.hardware_trigger:
            end = clock() + seconds
        if switch is not None:
            switch.first_step(part)
        newest = np.concatenate((newest, part))[-CHECKED_SAMPLES:]
        if clock() >= look_at and len(newest) == CHECKED_SAMPLES:
            before.appendleft(newest)
            look_at = clock() + seconds / (_EARLIER_LOOKS + 1)
    if newest.shape[0] < CHECKED_SAMPLES // 16:
        waited = "before its trigger" if able.hardware_trigger else f"in {wait_s:g} s"
        raise DigitizerError(f"{able.name} sent no samples {waited}", "fire its trigger, and check its cables")
    return [newest, *before]


CHECKED_SAMPLES = 8192
_LINE_HALF_WIDTH = 4  # bins that one line of the Hann window takes
_LINE_BELOW_NOISE_DB = 3.0  # the weakest line, below the total noise; the greatest of 4096 noise lines is 20 dB lower


def check_signals(
    counts: NDArray[np.int16], channels: tuple[Channel, ...], sample_rate_hz: float, bits: int
) -> tuple[ChannelSignal, ...]:
    """Measure each channel's signal in ``counts``, shape (n, channels), n at least 64; O(n log n)."""
    rail = 1 << (bits - 1)
    signals = []
    for taken, channel in zip(counts.T, channels, strict=True):
        clipped = float(np.mean((taken >= rail - 1) | (taken <= -rail)))
        range_v = rail * abs(channel.volts_per_count)
        if channel.role is Role.SWITCH:
            level = float(np.median(taken)) * channel.volts_per_count + channel.offset_v
            signals.append(ChannelSignal(channel.role, level, range_v, clipped, None, None))
            continue
        amplitude = float(np.std(taken) * np.sqrt(2.0) * abs(channel.volts_per_count))
        frequency, snr = _strongest_line(taken - taken.mean(), sample_rate_hz)
        signals.append(ChannelSignal(channel.role, amplitude, range_v, clipped, frequency, snr))
    return tuple(signals)


def _strongest_line(values: NDArray[np.float64], sample_rate_hz: float) -> tuple[float | None, float | None]:
    """Return frequency in Hz and power over all other power in dB of the strongest line of values (n,).

    None if it is noise.
    """
    spectrum = np.fft.rfft(values * np.hanning(values.size))
    power = spectrum.real**2 + spectrum.imag**2
    power[:_LINE_HALF_WIDTH] = 0.0
    peak = int(np.argmax(power))
    if power[peak] <= 0.0:
        return None, None
    line = float(power[peak - _LINE_HALF_WIDTH : peak + _LINE_HALF_WIDTH + 1].sum())
    rest = float(power.sum()) - line
    snr = 10 * np.log10(line / max(rest, 1e-12 * line))
    if snr < -_LINE_BELOW_NOISE_DB:
        return None, None
    offset = 0.0
    around = power[peak - 1 : peak + 2]
    if around.size == 3 and around.min() > 0.0:  # the peak is the first maximum, so it exceeds its left neighbour
        left, middle, right = np.log(around)
        offset = 0.5 * (left - right) / (left - 2 * middle + right)
    return float((peak + offset) * (sample_rate_hz / values.size)), float(snr)
