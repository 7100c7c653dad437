"""A short look at a source's signals, for those who have no screen: what the set-up shows, in lines."""

import time
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Role
from instrument.capture.capture_options import usual_settings
from instrument.capture.trigger import LightSwitch, TriggerSettings
from instrument.devices.digitizer import Digitizer, DigitizerError
from instrument.devices.doctor import Check, Grade
from instrument.live.setup_check import CHECKED_SAMPLES, check_setup

LOOKS_S = 3.0  # time to pass the block through the light switch by hand
TRIGGERS_S = 20.0
_BLOCK = 1 << 17
_TIMEOUT_S = 0.05
_LOOKS = 4  # besides the newest


def try_signals(
    digitizer: Digitizer, seconds: float = LOOKS_S, clock: Callable[[], float] = time.monotonic
) -> tuple[Check, ...]:
    """Return the verdicts on the signals of an opened digitizer, the block at rest.

    A stream is watched for ``seconds``, the light switch's changes are counted over all of them.  A device that
    triggers by itself is judged by one shot, and has TRIGGERS_S for it.  Raises DigitizerError; stops the digitizer.
    """
    able = digitizer.capabilities
    settings = usual_settings(digitizer)
    channels, bits = able.channels, able.bits
    column = next((n for n, channel in enumerate(channels) if channel.role is Role.SWITCH), None)
    switch = LightSwitch(TriggerSettings(), column, bits) if column is not None else None
    buffer = np.empty((_BLOCK, len(channels)), np.int16)
    newest = np.empty((0, len(channels)), np.int16)
    before: deque[NDArray[np.int16]] = deque(maxlen=_LOOKS)
    digitizer.arm(settings)
    try:
        end = clock() + (TRIGGERS_S if able.hardware_trigger else seconds)
        look_at = clock()
        ended = False
        while clock() < end and not ended:
            block = digitizer.read_into(buffer, _TIMEOUT_S)
            part = buffer[: block.samples]
            ended = block.ended
            if switch is not None and len(part):
                switch.first_step(part)
            newest = np.concatenate((newest, part))[-CHECKED_SAMPLES:]
            if clock() >= look_at and len(newest) == CHECKED_SAMPLES:
                before.appendleft(newest)
                look_at = clock() + seconds / (_LOOKS + 1)
    finally:
        digitizer.stop()
    if newest.shape[0] < CHECKED_SAMPLES // 16:
        waited = "before its trigger" if able.hardware_trigger else f"in {seconds:g} s"
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
    # A block that is just passing the switch is not at rest: it was, or will be, in another look.
    return next((checks for checks in judged if all(check.grade is Grade.OK for check in checks)), latest)
