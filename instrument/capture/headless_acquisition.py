"""Record N shots without a screen: arm, wait for the light switch, save."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from analysis.shot import Setup
from instrument.capture.acquisition import Deadlines, State
from instrument.capture.capture import Capture
from instrument.capture.snapshot import FinishedShot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices import CaptureSettings, Digitizer
from instrument.files import RecordingError

_LOOK_S = 0.01
RESCUED = "levimass-rescued"  # a folder in the user's home, or with the temporary files


class AcquireError(Exception):
    """The reason why recording ended, in one line; ``saved`` are the recordings made before."""

    def __init__(self, what: str, saved: list[Path]) -> None:
        super().__init__(what)
        self.saved = saved


def acquire(
    digitizer: Digitizer,
    out: Path,
    shots: int,
    settings: CaptureSettings | None = None,
    timeout_s: float = 60.0,
    report: Callable[[str], None] = lambda line: None,
    *,
    setup: Setup | None = None,
) -> list[Path]:
    """Record ``shots`` shots into ``out`` and return the paths of their metadata.

    ``settings`` None: ``usual_settings`` before each shot; ``setup`` None: the digitizer's own.  ``timeout_s`` is the
    longest wait for each trigger; ``report`` gets one line per shot.  Raises AcquireError.  Closes the digitizer.
    """
    saved: list[Path] = []
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        digitizer.close()
        raise AcquireError(f"{out}: {error.strerror}", saved) from None
    faults: list[str] = []
    capture = Capture(
        digitizer,
        CaptureOptions(out, settings, setup),
        live=False,
        deadlines=Deadlines(armed_s=timeout_s),
        say=faults.append,
    )
    try:
        with capture:
            for number in range(shots):
                capture.arm()
                shot = _wait(capture, number + 1, timeout_s, faults)
                assert shot.path is not None
                saved.append(shot.path)
                cut = f" ({shot.problem})" if shot.problem else ""
                report(f"shot {number + 1} of {shots}: {shot.path}{cut}")
    except AcquireError as failed:
        now = capture.latest()  # after close: a shot in progress is saved, or only in memory
        saved += [shot.path for shot in now.finished if shot.path is not None and shot.path not in saved]
        what = f"{now.message}: {_rescued(capture)}" if now.unsaved else str(failed)
        raise AcquireError(what, saved) from None
    return saved


def _rescued(capture: Capture) -> str:
    """Save the shots that are only in memory wherever there is room; return one line that says where they are."""
    left = list(capture.latest().unsaved)
    for place in (Path.home(), Path(tempfile.gettempdir())):
        folder = place / RESCUED
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
            paths = capture.save_pending(folder)
        except (OSError, RecordingError):
            continue
        return f"the shot was saved to {', '.join(map(str, paths))} instead; make room, then go on"
    return f"{', '.join(left)} is lost: there is no room in the home folder or the temporary one either"


def _wait(capture: Capture, index: int, timeout_s: float, faults: list[str]) -> FinishedShot:
    while True:
        now = capture.latest()
        for shot in now.finished:
            if shot.index >= index and shot.path is not None and now.state is State.IDLE:
                return shot
        if now.state is State.FAULT:
            raise AcquireError(faults[-1] if faults else now.message, [])
        if now.state is State.IDLE and now.message:
            raise AcquireError(f"{now.message} ({timeout_s:g} s): {now.remedy}", [])
        time.sleep(_LOOK_S)
