"""The samples of all runs in one row after another, and what any law makes of them through the same filter."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import Law
from analysis.drive.run import Run
from analysis.shot.shot import Cancelled, Stop

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
_KEPT = 40  # columns of laws kept a table


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The samples of all runs in one row after another, m in all, and the force of any law there, filtered.

    ``stop`` is asked at every fit to the table and every trial of one: where it says so, Cancelled is raised.
    """

    runs: tuple[Run, ...]
    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    record: NDArray[np.int64]
    stop: Stop
    _seen: dict[tuple[str, tuple[float, ...]], Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, runs: Sequence[Run], stop: Stop = lambda: False) -> "Table":
        """Return the table of the samples used of ``runs``."""

        def all_of(name: str) -> Floats:
            return np.concatenate([getattr(run, name)[run.used] for run in runs])

        return cls(
            tuple(runs), all_of("time_s"), all_of("displacement_m"), all_of("velocity_m_per_s"),
            all_of("acceleration_m_per_s2"), np.concatenate([np.full(run.used.size, run.record) for run in runs]), stop,
        )  # fmt: skip

    def check(self) -> None:
        """Raise Cancelled where nobody waits any longer for what is worked out."""
        if self.stop():
            raise Cancelled

    @property
    def everything(self) -> Mask:
        """Get the mask of all samples."""
        return np.ones(self.time_s.size, dtype=np.bool_)

    def force(self, later_s: float = 0.0) -> Floats:
        """Return the filtered force, shape (m,), taken ``later_s`` before the motion."""
        return self._kept("", (later_s,), lambda run: (run.force_n,), later_s)[:, 0]

    def columns(self, law: Law, bent: tuple[float, ...]) -> Floats:
        """Return the filtered force of a law a unit of its linear parameters, shape (m, k)."""
        make = law.force
        assert make is not None
        return self._kept(law.name, bent, lambda run: make(run, bent))

    def base(self) -> Floats:
        """Return the columns of mass, drag and offset, shape (m, 3)."""
        return np.stack([self.acceleration_m_per_s2, self.velocity_m_per_s, np.ones(self.time_s.size)], axis=1)

    def _kept(self, name: str, at: tuple[float, ...], make, later_s: float = 0.0) -> Floats:  # type: ignore[no-untyped-def]
        found = self._seen.pop((name, at), None)
        if found is None:
            found = np.concatenate([np.stack([run.smooth(c, later_s) for c in make(run)], axis=1) for run in self.runs])
        self._seen[name, at] = found
        while len(self._seen) > _KEPT:
            self._seen.pop(next(iter(self._seen)))
        return found
