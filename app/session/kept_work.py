"""Results kept for the next start, and read at it: errands of the workbench."""

from collections.abc import Mapping, Sequence
from functools import partial

from analysis.shot.shot import Shot
from app.session.event import Diagnosed, Reopened
from app.session.jobs import Asked, Report
from app.session.results import Key, Results
from app.session.work import Work

AT_ONCE = 10  # kept results are read and shown


class KeptWork:
    """Between the workbench and where results are kept."""

    def __init__(self, results: Results, work: Work) -> None:
        self._results, self._work = results, work

    def keep(self, shots: Sequence[Shot]) -> None:
        """Queue the keeping of analysed shots."""

        def work(_: Report, __: Asked) -> None:
            for shot in shots:
                self._results.keep_shot(shot)

        self._work.errands.submit("keeping results", work, "keep")

    def keep_diagnosis(self, found: Diagnosed, keys: Sequence[Key]) -> None:
        """Queue the keeping of a diagnosis; ``keys`` are those of its entries, in its order."""
        if len(keys) == len(found.numbers):
            self._work.errands.submit(
                "keeping a diagnosis", lambda _, __: self._results.keep_diagnosis(found.diagnosis, keys), "keep"
            )

    def ask(self, keys: Mapping[int, Key]) -> None:
        """Queue the reading of what was kept of these entries, the last first: the session opens there."""
        numbers = list(keys)[::-1]
        for start in range(0, len(numbers), AT_ONCE):
            some = numbers[start : start + AT_ONCE]
            self._work.submit(self._work.errands, "kept results", partial(self._shots, some, keys), "kept")
        self._work.submit(self._work.errands, "kept diagnoses", partial(self._diagnoses, keys), "kept")

    def _shots(self, numbers: Sequence[int], keys: Mapping[int, Key], _: Report, cancelled: Asked) -> Reopened:
        shots: list[tuple[int, Shot, str]] = []
        for number in numbers:
            kept = None if cancelled() else self._results.shot(keys[number])
            if kept is not None:
                shots.append((number, kept.shot, kept.version))
        done = {number for number, *_ in shots}
        return Reopened(tuple(shots), tuple(number for number in numbers if number not in done))

    def _diagnoses(self, keys: Mapping[int, Key], _: Report, __: Asked) -> Reopened:
        number_of = {key.bare: number for number, key in keys.items()}
        kept = self._results.diagnoses(keys.values())
        found = (Diagnosed(one.diagnosis, tuple(number_of[key] for key in one.of), one.version) for one in kept)
        return Reopened((), (), tuple(found))
