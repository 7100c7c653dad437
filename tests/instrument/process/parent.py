"""A parent that streams from a child until it is killed: ``python -m tests.instrument.process.parent``."""

import numpy as np

from instrument.devices.digitizer import CaptureSettings
from instrument.process.subprocess_digitizer import SubprocessDigitizer
from tests.child import child_id
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer


def main() -> None:
    """Say which child it is and what memory they share, then read on and on."""
    digitizer = SubprocessDigitizer(FakeDigitizer)
    digitizer.arm(CaptureSettings(RATE_HZ, 1000, 0))
    buffer = np.empty((10_000, 3), np.int16)
    digitizer.read_into(buffer, 5.0)
    print(child_id(digitizer), flush=True)
    while True:
        digitizer.read_into(buffer, 0.05)


if __name__ == "__main__":
    main()
