"""The diagnoses of a session, the newest last."""

from collections.abc import Sequence

from app.session.event import Diagnosed


class Diagnoses(list[Diagnosed]):
    """Finds the one that a selection is about."""

    @property
    def newest(self) -> Diagnosed | None:
        """Get the newest diagnosis."""
        return self[-1] if self else None

    def of(self, numbers: Sequence[int]) -> Diagnosed | None:
        """Return the newest diagnosis of just these entries, else of some with the last of them, or None."""
        newest = self[::-1]
        exact = next((found for found in newest if set(found.numbers) == set(numbers)), None)
        return exact or next((found for found in newest if set(numbers[-1:]) & set(found.numbers)), None)

    def within(self, chosen: set[int]) -> Diagnosed | None:
        """Return the newest diagnosis of which every entry is among these, or None."""
        return next((found for found in self[::-1] if set(found.numbers) <= chosen), None)
