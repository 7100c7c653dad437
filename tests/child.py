"""The process number of what computes or reads a device in a subprocess."""

from instrument.process.subprocess_digitizer import SubprocessDigitizer
from instrument.process.subprocess_worker import SubprocessWorker


def child_id(parent: SubprocessWorker | SubprocessDigitizer) -> int | None:
    """Return the number of its child, None where there is none."""
    child = (parent._child if isinstance(parent, SubprocessDigitizer) else parent)._process
    return None if child is None or child.over else child._process.pid
