"""Run by test_niscope_card in a process of its own, where NI's package finds the stub library; prints JSON."""

import json
import sys
import threading
import time

import numpy as np

from analysis.shot.recording import Role
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.niscope_card import NiscopeCard
from instrument.devices.triggered_digitizer import HardwareTrigger


def shot() -> dict:
    card = NiscopeCard("Dev1", {"0": Role.REFERENCE, "3": Role.MEASUREMENT}, HardwareTrigger("2", "falling", 1.5))
    samples = 500_000
    card.arm(CaptureSettings(3e7, samples, 50_000))
    expected = np.stack([np.arange(samples) % 30000 + 1000 * n for n in (0, 3)], axis=1)
    buffer = np.empty((123_456, 2), np.int16)
    at, trigger, same = 0, None, True
    for _ in range(20):
        block = card.read_into(buffer, 1.0)
        if block.trigger_sample is not None:
            trigger = at + block.trigger_sample
        same = same and bool(
            np.array_equal(buffer[: block.samples], expected[at : at + block.samples].astype(np.int16))
        )
        at += block.samples
        if block.ended:
            break
    scales = [(c.role, c.volts_per_count, c.offset_v) for c in card.capabilities.channels]
    try:
        card.arm(CaptureSettings(9e7, 1000, 0))
        refused = ""
    except DigitizerError as error:
        refused = str(error)
    card.close()
    return {"samples": at, "trigger": trigger, "same": same, "scales": scales, "refused": refused}


def cancelled() -> dict:
    card = NiscopeCard("Dev1", trigger=HardwareTrigger("PFI_1", level_v=1.0))
    card.arm(CaptureSettings(1e7, 1000, 0))
    buffer = np.empty((10, 2), np.int16)
    first = card.read_into(buffer, 0.05)
    threading.Timer(0.1, card.stop).start()
    begun = time.monotonic()
    last = card.read_into(buffer, 10.0)
    seconds = time.monotonic() - begun
    card.close()
    return {"first": first.samples, "ended": last.ended, "seconds": seconds}


def absent() -> dict:
    try:
        NiscopeCard("Dev9")
    except DigitizerError as error:
        return {"line": str(error)}
    return {}


if __name__ == "__main__":
    print(json.dumps({"shot": shot, "cancelled": cancelled, "absent": absent}[sys.argv[1]]()))
