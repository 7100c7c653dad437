"""What the two processes tell each other; orders go one way, answers and blocks the other, each in its order."""

import os
import sys
from dataclasses import dataclass

from analysis.shot.recording import Setup
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings


@dataclass(frozen=True, slots=True)
class Order:
    """Something to be done; ``serial`` numbers the orders of one process."""

    kind: str  # prepare, defaults, arm, stop, close
    serial: int
    settings: CaptureSettings | None = None
    ring: tuple[str, int, int] | None = None  # name, capacity, channels of new memory


@dataclass(frozen=True, slots=True)
class Fault:
    """A DigitizerError on its way."""

    what: str
    remedy: str


@dataclass(frozen=True, slots=True)
class About:
    """What the device says of itself; ``fault`` where it cannot say it (any more)."""

    capabilities: Capabilities | None
    setup: Setup | None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The end of the order ``serial``; ``first`` is the number of the next sample, after ``arm``."""

    serial: int
    about: About | None
    fault: Fault | None = None
    settings: CaptureSettings | None = None
    first: int = 0
    blocks: int = 0


@dataclass(frozen=True, slots=True)
class Came:
    """A block in the ring, or a fault in its place, of the stream that the order ``run`` began."""

    run: int
    first: int
    block: Block
    fault: Fault | None = None
    about: About | None = None  # where the stream ended: another shot may be another thing


_BELOW_NORMAL = 0x4000  # BELOW_NORMAL_PRIORITY_CLASS of SetPriorityClass


def give_way(steps: int) -> None:
    """Lower this process' priority by ``steps`` (Windows: below normal); on Linux it pushes no other off its core."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), _BELOW_NORMAL)
    else:
        os.nice(steps)
    if sys.platform == "linux":
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
