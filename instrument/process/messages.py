"""The messages between the program and the device's process: orders one way, answers and blocks the other."""

import os
import sys
from dataclasses import dataclass
from typing import Any

from analysis.shot import Setup
from instrument.devices import Block, Capabilities, CaptureSettings


@dataclass(frozen=True, slots=True)
class Order:
    """A request to the device's process; ``serial`` numbers the orders of one process."""

    kind: str  # prepare, defaults, arm, stop, close
    serial: int
    settings: CaptureSettings | None = None
    ring: tuple[str, int, int] | None = None  # name, capacity, channels of new memory


@dataclass(frozen=True, slots=True)
class Fault:
    """A DigitizerError as it is sent from one process to the other."""

    what: str
    remedy: str


@dataclass(frozen=True, slots=True)
class DeviceState:
    """Capabilities and setup of the device; ``fault`` says why they cannot be read."""

    capabilities: Capabilities | None
    setup: Setup | None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to the order ``serial``; after ``arm``, ``first`` is the number of the next sample."""

    serial: int
    device: DeviceState | None
    fault: Fault | None = None
    settings: CaptureSettings | None = None
    first: int = 0
    blocks: int = 0


@dataclass(frozen=True, slots=True)
class BlockReady:
    """A block in the ring, or a fault instead of one, of the stream that the order ``run`` began."""

    run: int
    first: int
    block: Block
    fault: Fault | None = None
    device: DeviceState | None = None  # when the stream ends: the next shot may have other capabilities

    def __reduce__(self) -> tuple[Any, ...]:  # as of a Block
        return BlockReady, (self.run, self.first, self.block, self.fault, self.device)


_BELOW_NORMAL = 0x4000  # BELOW_NORMAL_PRIORITY_CLASS of SetPriorityClass


def lower_priority(steps: int) -> None:
    """Lower this process' priority by ``steps`` (Windows: to below normal); on Linux also its scheduling class."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), _BELOW_NORMAL)
    else:
        os.nice(steps)
    if sys.platform == "linux":
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
