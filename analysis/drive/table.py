"""The compared samples of all stretches in one table, and the filtered force of any law at them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import Law
from analysis.drive.stretch import Stretch
from analysis.shot import Cancelled, Stop

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
_MOST_CACHED = 40  # columns of laws kept a table


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The compared samples of all stretches, m in all; arrays of shape (m,).

    ``stop`` is called at every evaluation of a fit; where it returns True, Cancelled is raised.
    """

    stretches: tuple[Stretch, ...]
    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    record: NDArray[np.int64]
    stop: Stop
    _seen: dict[tuple[str, tuple[float, ...]], Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, stretches: Sequence[Stretch], stop: Stop = lambda: False) -> "Table":
        def all_of(name: str) -> Floats:
            return np.concatenate([getattr(stretch, name)[stretch.used] for stretch in stretches])

        record = np.concatenate([np.full(stretch.used.size, stretch.record) for stretch in stretches])
        return cls(
            tuple(stretches), all_of("time_s"), all_of("displacement_m"), all_of("velocity_m_per_s"),
            all_of("acceleration_m_per_s2"), record, stop,
        )  # fmt: skip

    def raise_if_cancelled(self) -> None:
        if self.stop():
            raise Cancelled

    @property
    def everything(self) -> Mask:
        return np.ones(self.time_s.size, dtype=np.bool_)

    def force(self, later_s: float = 0.0) -> Floats:
        """Return the filtered measured force, shape (m,), delayed by ``later_s``."""
        return self._cached("", (later_s,), lambda stretch: (stretch.force_n,), later_s)[:, 0]

    def columns(self, law: Law, nonlinear: tuple[float, ...]) -> Floats:
        """Return the filtered force of a law per unit of each of its k linear parameters, shape (m, k)."""
        make = law.force
        assert make is not None
        return self._cached(law.name, nonlinear, lambda stretch: make(stretch, nonlinear))

    def base(self) -> Floats:
        """Return the regressors of mass, drag and offset, shape (m, 3)."""
        return np.stack([self.acceleration_m_per_s2, self.velocity_m_per_s, np.ones(self.time_s.size)], axis=1)

    def _cached(self, name: str, at: tuple[float, ...], make, later_s: float = 0.0) -> Floats:  # type: ignore[no-untyped-def]
        found = self._seen.pop((name, at), None)
        if found is None:
            found = np.concatenate([np.stack([s.smooth(c, later_s) for c in make(s)], axis=1) for s in self.stretches])
        self._seen[name, at] = found
        while len(self._seen) > _MOST_CACHED:
            self._seen.pop(next(iter(self._seen)))
        return found
