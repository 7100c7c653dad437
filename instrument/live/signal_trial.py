"""A short check of a source's signals without a screen: what the guided set-up shows, as lines of text."""

import time
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Role
from instrument.devices import Check, Digitizer, DigitizerError, Grade, usual_settings
from instrument.live.setup_check import CHECKED_SAMPLES, check_setup
from instrument.process import SIMULATED_ANSWER_S
from instrument.trigger import LightSwitch, TriggerSettings

WATCHED_S = 3.0  # time to pass the block through the light switch by hand
TRIGGER_WAIT_S = 20.0
_BLOCK = 1 << 17
_TIMEOUT_S = 0.05
_EARLIER_LOOKS = 4  # before the newest one


def try_signals(
    digitizer: Digitizer, seconds: float = WATCHED_S, clock: Callable[[], float] = time.monotonic
) -> tuple[Check, ...]:
    """Check the signals of an opened digitizer, the block at rest.

    A stream is watched for ``seconds`` from its first samples on, for which it has as long; the light switch's changes
    are counted.  A device with a hardware trigger is checked by one shot, for which it has TRIGGER_WAIT_S.  Raises
    DigitizerError; stops the digitizer.
    """
    able = digitizer.capabilities
    settings = usual_settings(digitizer)
    channels, bits = able.channels, able.bits
    column = next((n for n, channel in enumerate(channels) if channel.role is Role.SWITCH), None)
    switch = LightSwitch(TriggerSettings(), column, bits) if column is not None else None
    buffer = np.empty((_BLOCK, len(channels)), np.int16)
    newest = np.empty((0, len(channels)), np.int16)
    before: deque[NDArray[np.int16]] = deque(maxlen=_EARLIER_LOOKS)
    digitizer.arm(settings)
    try:
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
            if switch is not None and len(part):
                switch.first_step(part)
            newest = np.concatenate((newest, part))[-CHECKED_SAMPLES:]
            if clock() >= look_at and len(newest) == CHECKED_SAMPLES:
                before.appendleft(newest)
                look_at = clock() + seconds / (_EARLIER_LOOKS + 1)
    finally:
        digitizer.stop()
    if newest.shape[0] < CHECKED_SAMPLES // 16:
        waited = "before its trigger" if able.hardware_trigger else f"in {wait_s:g} s"
        raise DigitizerError(f"{able.name} sent no samples {waited}", "fire its trigger, and check its cables")
    toggles = switch.toggles if switch is not None else None
    rest_hz = digitizer.setup.rest_frequency_hz
    judged = (
        check_setup(look, channels, settings.sample_rate_hz, bits, toggles=toggles, rest_frequency_hz=rest_hz)
        for look in (newest, *before)
    )
    latest = next(judged)
    if all(check.grade is Grade.OK for check in latest) or any(check.grade is Grade.FAIL for check in latest):
        return latest
    # a block that is passing the switch is not at rest: use an earlier look in which it was
    return next((checks for checks in judged if all(check.grade is Grade.OK for check in checks)), latest)
