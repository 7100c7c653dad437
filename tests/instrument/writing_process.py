"""A process that takes shots into a folder until it is killed."""

import json
import sys
import time
from pathlib import Path

from app.session.settings import Settings
from app.session.settings_store import save
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer


def main(folder: Path) -> None:
    """Take shots, say each that is saved on standard output, and rewrite the settings between them."""
    capture = Capture(FakeDigitizer(), CaptureOptions(folder, CaptureSettings(RATE_HZ, 20_000, 4_000)), live=False)
    capture.start()
    capture.arm(automatic=True)
    said = 0
    length_s = 0.1
    while True:
        now = capture.latest()
        for shot in now.finished:
            if shot.number > said:
                said = shot.number
                print(json.dumps(str(shot.path)), flush=True)
        length_s = 0.1 + (said % 100) * 1e-3
        save(folder / "settings.json", Settings(duration_s=length_s))
        time.sleep(0.001)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
