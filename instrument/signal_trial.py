"""A short look at a source's signals, for those who have no screen: what the set-up shows, in lines."""

import time
from collections.abc import Callable

import numpy as np

from analysis.recording import Role
from instrument.digitizer import Digitizer, DigitizerError
from instrument.doctor import Check
from instrument.setup_check import check_setup
from instrument.signal_check import CHECKED_SAMPLES
from instrument.trigger import LightSwitch, TriggerSettings
from instrument.usual_settings import usual_settings

LOOKS_S = 3.0  # time to pass the block through the light switch by hand
TRIGGERS_S = 20.0
_BLOCK = 1 << 17
_TIMEOUT_S = 0.05


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
    digitizer.arm(settings)
    try:
        end = clock() + (TRIGGERS_S if able.hardware_trigger else seconds)
        ended = False
        while clock() < end and not ended:
            block = digitizer.read_into(buffer, _TIMEOUT_S)
            part = buffer[: block.samples]
            ended = block.ended
            if switch is not None and len(part):
                switch.first_step(part)
            newest = np.concatenate((newest, part))[-CHECKED_SAMPLES:]
    finally:
        digitizer.stop()
    if newest.shape[0] < CHECKED_SAMPLES // 16:
        waited = "before its trigger" if able.hardware_trigger else f"in {seconds:g} s"
        raise DigitizerError(f"{able.name} sent no samples {waited}", "fire its trigger, and check its cables")
    toggles = switch.toggles if switch is not None else None
    rest_hz = digitizer.setup.rest_frequency_hz
    return check_setup(newest, channels, settings.sample_rate_hz, bits, toggles=toggles, rest_frequency_hz=rest_hz)
