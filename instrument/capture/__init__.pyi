from .acquisition import CAN_ARM, Acquisition, Deadlines, State
from .analysis_thread import ShotAnalysis, fit_here
from .capture import AcquireError, Capture, acquire
from .snapshot import CapturedShot, SignalLine, Snapshot
from .stream_reader import CaptureOptions

__all__ = [
    "CAN_ARM",
    "AcquireError",
    "Acquisition",
    "Capture",
    "CaptureOptions",
    "CapturedShot",
    "Deadlines",
    "ShotAnalysis",
    "SignalLine",
    "Snapshot",
    "State",
    "acquire",
    "fit_here",
]
