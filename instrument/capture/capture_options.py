"""How shots are to be taken, as the operator chose it."""

from dataclasses import dataclass
from pathlib import Path

from analysis.shot.recording import Setup
from instrument.capture.trigger import Edge
from instrument.devices.digitizer import CaptureSettings


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """How shots are to be taken.

    ``settings`` None: see usual_settings; ``setup`` None the rig the digitizer knows.  Thresholds of
    the light switch are in V, None learns them.  ``watch``: signals are read before arming too, where the digitizer
    streams.  Where no channel carries a light switch and the hardware has no trigger, the block itself fires as soon
    as it moves faster than ``trigger_speed_m_per_s``; None leaves it to the operator.  The folder must exist.
    """

    folder: Path
    settings: CaptureSettings | None = None
    setup: Setup | None = None
    edge: Edge = Edge.EITHER
    switch_low_v: float | None = None
    switch_high_v: float | None = None
    trigger_speed_m_per_s: float | None = 0.05
    watch: bool = True
    prefix: str = "shot"
