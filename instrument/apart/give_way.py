"""Let a process give way to the one with the screen."""

import os


def give_way(steps: int) -> None:
    """Lower this process' priority by ``steps``, and let it wake without pushing another off its core (Linux)."""
    if hasattr(os, "nice"):
        os.nice(steps)
    if hasattr(os, "SCHED_BATCH"):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
