"""The process number of what computes or reads a device in a subprocess."""

from instrument.process.device_process import DeviceProcess
from instrument.process.subprocess_digitizer import SubprocessDigitizer
from instrument.process.subprocess_worker import SubprocessWorker


def child_id(parent: SubprocessWorker | SubprocessDigitizer) -> int | None:
    """Return the number of its child, None where there is none."""
    child: SubprocessWorker | DeviceProcess = parent._child if isinstance(parent, SubprocessDigitizer) else parent
    ended = child.over if isinstance(child, DeviceProcess) else child._process is None
    return None if ended or child._process is None else child._process.pid
