"""Whether the analysis says that PD0 and PD1 of a shot are swapped."""

from analysis.shot.shot import Shot

WORD = "swapped"  # of what the demodulation says where PD0's beat moves and PD1's stands still


def is_swapped(shot: Shot | None) -> bool:
    """Return whether a shot was not analysed because its PD0 and PD1 are swapped."""
    return shot is not None and shot.problem is not None and WORD in shot.problem
