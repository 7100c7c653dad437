"""Run by test_hantek6022_usb under umockdev-wrapper; plays one scene with unmodified libusb and prints JSON."""

import contextlib
import io
import json
import sys
import threading
import time
from pathlib import Path

import numpy as np

from analysis.shot.recording import Role
from app.command_line import acquire
from instrument.devices import hantek6022, streamed_codes
from instrument.devices.device_search import found_devices
from instrument.devices.digitizer import CaptureSettings, Digitizer, DigitizerError
from instrument.devices.hantek6022 import Hantek6022
from instrument.process import device_process
from instrument.process.subprocess_digitizer import open_in_subprocess
from tests.child import child_id
from tests.instrument.devices.hantek_model import ColdHantek, WarmHantek, packet_numbers
from tests.instrument.devices.usbfs_emulator import Testbed

ROLES = (Role.SWITCH, Role.MEASUREMENT)


def without_clock() -> None:
    """Let the byte clock tell nothing: on a busy computer the emulator lags as no device does."""
    streamed_codes.SHORT_STEP_S = streamed_codes.LONG_STEP_S = 1e9


def read(scope: Digitizer, seconds: float, gap_after: int | None = None) -> dict:
    """Read for a while, or until a gap is told after a sample; return the packets' numbers, gaps and the end."""
    numbers, gaps, got, fault = [], [], 0, ""
    buffer = np.empty((1 << 18, 2), np.int16)
    rest = np.empty((0, 2), np.int16)
    begun = time.monotonic()
    try:
        while time.monotonic() - begun < seconds:
            taken = scope.read_into(buffer, 0.05)
            if taken.lost_before is None:
                gaps.append(got)
            got += taken.samples
            rest = np.concatenate((rest, buffer[: taken.samples]))
            whole = rest.shape[0] // 256 * 256
            numbers.append(packet_numbers(rest[:whole]))
            rest = rest[whole:]
            if taken.ended or (gap_after is not None and gaps and gaps[-1] > gap_after):
                break
    except DigitizerError as error:
        fault = str(error)
    all_numbers = np.concatenate(numbers) if numbers else np.empty(0, int)
    steps = np.diff(all_numbers)
    return {
        "samples": got,
        "seconds": time.monotonic() - begun,
        "first": int(all_numbers[0]) if all_numbers.size else None,
        "breaks": [[int(at) + 1, int(steps[at])] for at in np.flatnonzero(steps != 1)],
        "gaps": gaps,
        "fault": fault,
    }


def firmware() -> dict:
    without_clock()
    bed = Testbed()
    warm = WarmHantek()

    def run() -> None:
        bed.unplug(1)
        time.sleep(0.2)
        bed.plug(warm, 2)

    cold = ColdHantek(run)
    bed.plug(cold, 1)
    image = np.random.default_rng(5).integers(0, 256, 16312).astype(np.uint8).tobytes()
    path = Path(sys.argv[2]) / "image.fw"
    path.write_bytes(image)
    found = [(d.source, d.problem) for d in found_devices()]
    scope = Hantek6022(ROLES, firmware=path)
    scope.arm(CaptureSettings(1e6, 1000, 0))
    result = read(scope, 0.5)
    scope.close()
    return {"found": found, "loaded": bytes(cold.ram[: len(image)]) == image, "told": warm.told, "read": result}


def streaming() -> dict:
    without_clock()
    bed = Testbed()
    plugged = bed.plug(WarmHantek(), 3)
    scope = Hantek6022(ROLES)
    try:
        Hantek6022(ROLES)
        second = ""
    except DigitizerError as error:
        second = str(error)
    scope.arm(CaptureSettings(15e6, 1000, 0))
    result = read(scope, 2.5)
    cpu = time.process_time()
    scope.close()
    return {
        "read": result,
        "second": second,
        "claimed": plugged.claimed,
        "cpu": cpu,
        "threads": threading.active_count(),
    }


def stall() -> dict:
    without_clock()
    bed = Testbed()
    model = WarmHantek()
    bed.plug(model, 1)
    scope = Hantek6022(ROLES)
    model.stalls = [2 << 20]
    scope.arm(CaptureSettings(10e6, 1000, 0))
    once = read(scope, 0.8)
    scope.stop()
    model.stalls = [1 << 20] + [0] * 20
    scope.arm(CaptureSettings(10e6, 1000, 0))
    always = read(scope, 1.5)
    model.stalls = []
    model.clear_halt()
    scope.arm(CaptureSettings(10e6, 1000, 0))
    after = read(scope, 0.3)
    scope.close()
    return {"once": once, "always": always, "after": after}


def silence() -> dict:
    without_clock()
    hantek6022.SILENCE_S = 0.4
    bed = Testbed()
    model = WarmHantek()
    model.silent_from = 1 << 20
    bed.plug(model, 1)
    scope = Hantek6022(ROLES)
    scope.arm(CaptureSettings(10e6, 1000, 0))
    result = read(scope, 3.0)
    model.silent_from = None
    scope.arm(CaptureSettings(10e6, 1000, 0))
    after = read(scope, 0.3)
    scope.close()
    return {"read": result, "after": after}


def overrun() -> dict:
    bed = Testbed()
    model = WarmHantek()
    model.skip_at, model.skipped = 24 << 20, 3000 * 512
    bed.plug(model, 1)
    scope = Hantek6022(ROLES)
    scope.arm(CaptureSettings(10e6, 1000, 0))
    result = read(scope, 20.0, gap_after=(24 << 20) // 2)
    scope.close()
    return {"read": result}


def unplug() -> dict:
    without_clock()
    bed = Testbed()
    bed.plug(WarmHantek(), 1)
    scope = Hantek6022(ROLES)
    settings = CaptureSettings(10e6, 1000, 0)
    scope.arm(settings)
    threading.Timer(0.5, bed.unplug, (1,)).start()
    result = read(scope, 3.0)
    try:
        scope.arm(settings)
        missing = ""
    except DigitizerError as error:
        missing = str(error)
    bed.plug(WarmHantek(), 2)
    scope.arm(settings)
    again = read(scope, 0.4)
    scope.close()
    return {"read": result, "missing": missing, "again": again, "threads": threading.active_count()}


def apart() -> dict:
    """The device is owned by a child process, the emulator lives here."""
    bed = Testbed()
    bed.plug(WarmHantek(), 1)
    scope = open_in_subprocess("hantek6022?roles=switch,measurement")
    settings = CaptureSettings(1e6, 1000, 0)
    scope.arm(settings)
    threading.Timer(0.5, bed.unplug, (1,)).start()
    result = read(scope, 5.0)
    try:
        scope.arm(settings)
        missing = ""
    except DigitizerError as error:
        missing = str(error)
    bed.plug(WarmHantek(), 2)
    scope.arm(settings)
    again = read(scope, 0.4)
    scope.close()
    return {"read": result, "missing": missing, "again": again, "child": child_id(scope)}


def hang() -> dict:
    """A control request of opening, arming or stopping is never answered, under ``levimass acquire``."""
    bed = Testbed()
    acquire.MIN_ARMING_S = device_process.END_S = timeout_s = 1.0
    ended = {}
    for number, (what, request) in enumerate({"opening": 1, "arming": 5, "stopping": 8}.items(), 1):
        model = WarmHantek()
        model.hangs_at = request
        bed.plug(model, number)
        said = io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            request = acquire.CaptureRequest(
                source="hantek6022?roles=switch,measurement", out=Path(sys.argv[2]) / what, rate_hz=None,
                samples=None, timeout_s=timeout_s,
            )  # fmt: skip
            status = acquire.acquire(1, request)
        assert model.hung_s is not None
        ended[what] = (status, time.monotonic() - model.hung_s, said.getvalue())
        bed.unplug(number)
    return ended


def stop() -> dict:
    bed = Testbed()
    bed.plug(WarmHantek(), 1)
    scope = Hantek6022(ROLES)
    seconds = []
    for _ in range(10):
        scope.arm(CaptureSettings(1e5, 1000, 0))
        threading.Timer(0.05, scope.stop).start()
        begun = time.monotonic()
        while not scope.read_into(np.empty((1 << 16, 2), np.int16), 5.0).ended:
            pass
        seconds.append(time.monotonic() - begun)
    scope.close()
    return {"slowest": max(seconds)}


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]]()))
