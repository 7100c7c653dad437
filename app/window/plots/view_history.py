"""The stretches of a plot that a person looked at, to go back to and forward again."""

from typing import Generic, TypeVar

State = TypeVar("State")
MOST = 100


class ViewHistory(Generic[State]):
    """A list of states with a place in it; a state that is noted after going back takes the place of what followed."""

    def __init__(self) -> None:
        self._states: list[State] = []
        self._place = -1

    def clear(self) -> None:
        """Forget everything."""
        self._states, self._place = [], -1

    def note(self, state: State) -> None:
        """Take in what is looked at now; the same again is not taken twice."""
        if self._place >= 0 and self._states[self._place] == state:
            return
        self._states = [*self._states[: self._place + 1], state][-MOST:]
        self._place = len(self._states) - 1

    def step(self, by: int) -> State | None:
        """Go back (-1) or forward (1); return what was looked at there, None at the end."""
        place = self._place + by
        if not 0 <= place < len(self._states):
            return None
        self._place = place
        return self._states[place]
