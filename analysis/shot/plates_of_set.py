"""Number the plates and describe the added weights of a set of shots; check that its shots can be fitted together."""

from collections.abc import Sequence
from itertools import groupby

from analysis.shot.motion import Motion
from analysis.shot.plate import stated_stiffness_n_per_m
from analysis.shot.shot import Shot

_SAME_PLATE = 0.1  # relative difference of stiffness (3 % of thickness) above which two plates are different


def plate_numbers(motions: Sequence[Motion]) -> tuple[int, ...]:
    """Return the plate number of each shot, from 0 in order of appearance.

    Plates of nearly the same stiffness count as one.  A shot that states no plate is on the previous shot's plate.
    """
    known: list[float] = []
    numbers: list[int] = []
    for motion in motions:
        stated = stated_stiffness_n_per_m(motion.plate)
        if stated is None:
            numbers.append(numbers[-1] if numbers else 0)
            continue
        same = [k for k, stiffness in enumerate(known) if abs(stated / stiffness - 1) <= _SAME_PLATE]
        if not same:
            known.append(stated)
        numbers.append(same[0] if same else len(known) - 1)
    return tuple(numbers)


def plate_count(motions: Sequence[Motion]) -> int:
    return 1 + max(plate_numbers(motions), default=0)


def describe_plates(motions: Sequence[Motion]) -> str:
    """Return in words which shots are on which plate ("shots 1-3 on plate 1, 4-5 on plate 2"); "" with one plate."""
    numbers = plate_numbers(motions)
    return f"shots {group_shot_numbers([f'on plate {k + 1}' for k in numbers])}" if any(numbers) else ""


_SAME_KG = 1e-6  # a balance's resolution, 1 mg


def describe_weights(masses_kg: Sequence[float]) -> str:
    """Return the added weights in words ("shots 1-3 as found, 4-5 with 50.00 g added"); "" if all are equal.

    The lightest block of the set counts as found, without added weight.
    """
    if not masses_kg or max(masses_kg) - min(masses_kg) <= _SAME_KG:
        return ""
    found = min(masses_kg)
    added = [mass - found if mass - found > _SAME_KG else 0.0 for mass in masses_kg]
    kinds = [f"with {1e3 * kg:.2f} g added" if kg else "as found" for kg in added]
    return f"shots {group_shot_numbers(kinds)}"


def group_shot_numbers(kinds: Sequence[str]) -> str:
    """Group consecutive equal kinds by shot number: "1-3 as found, 4-5 with 50.00 g added"."""
    parts, number = [], 1
    for kind, group in groupby(kinds):
        count = len(list(group))
        parts.append(f"{number}-{number + count - 1} {kind}" if count > 1 else f"{number} {kind}")
        number += count
    return ", ".join(parts)


def why_no_joint_fit(shots: Sequence[Shot]) -> str | None:
    """Return in words why these shots cannot be fitted or diagnosed together; None if they can."""
    models = sorted({shot.settings.model for shot in shots})
    if len(models) > 1:
        return f"the shots use different base models ({', '.join(models)}): select shots of one"
    return None
