"""Which shots of a set were taken on which plate, as their recordings state it."""

from collections.abc import Sequence

from analysis.shot.motion import Motion
from analysis.shot.plate import stated_n_per_m
from analysis.shot.weights import numbered

_MEASURED_AGAIN = 0.1  # of the stiffness: the thickness to 3 %; further off it is another plate


def plate_numbers(motions: Sequence[Motion]) -> tuple[int, ...]:
    """Return the plate of each shot, counted from nothing in the order in which they come.

    A plate that is measured again is the same plate; a shot that states none is taken to be on the one before.
    """
    known: list[float] = []
    numbers: list[int] = []
    for motion in motions:
        stated = stated_n_per_m(motion.plate)
        if stated is None:
            numbers.append(numbers[-1] if numbers else 0)
            continue
        same = [k for k, stiffness in enumerate(known) if abs(stated / stiffness - 1) <= _MEASURED_AGAIN]
        if not same:
            known.append(stated)
        numbers.append(same[0] if same else len(known) - 1)
    return tuple(numbers)


def plate_count(motions: Sequence[Motion]) -> int:
    """Return on how many plates a set was taken."""
    return 1 + max(plate_numbers(motions), default=0)


def plates_words(motions: Sequence[Motion]) -> str:
    """Return who was taken on which plate ("shots 1-3 on plate 1, 4-5 on plate 2"); nothing where there is one."""
    numbers = plate_numbers(motions)
    return f"shots {numbered([f'on plate {k + 1}' for k in numbers])}" if any(numbers) else ""
