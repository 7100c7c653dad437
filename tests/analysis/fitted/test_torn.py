"""Recordings that are spliced or repeat a buffer give a sentence, not an exception."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.linalg import LinAlgError
from numpy.typing import NDArray

from analysis.pipeline import analyse
from analysis.reading.edges import edges_of_short_flight
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Shot
from tests.analysis.synthetic_collision import Synthetic
from tests.beats import recording_of

TURN = 243_000  # the sample at which the block turns


@lru_cache(maxsize=1)
def sound() -> Recording:
    return recording_of(Synthetic())


def of(counts: NDArray[np.int16]) -> Recording:
    counts = np.ascontiguousarray(counts)
    counts.flags.writeable = False
    return replace(sound(), counts=counts)


def check(shot: Shot) -> None:
    for words in (shot.problem, shot.fit_problem):
        assert words is None or ("\n" not in words and "Collision(" not in words and len(words) < 200)
    assert shot.flags or shot.problem


@pytest.mark.parametrize(
    "error",
    [LinAlgError("Singular matrix"), ValueError("cannot reshape array of size 0"), IndexError("index -1"),
     ZeroDivisionError("float division by zero")],
)  # fmt: skip
def test_a_fit_without_a_solution_keeps_the_readings(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def torn(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("analysis.inference.fit_shots", torn)
    shot = analyse(sound())
    assert shot.problem is None and shot.impact is not None and shot.fit is None
    assert shot.fit_problem == f"the model cannot be fitted to this motion ({error})"


@pytest.mark.parametrize("length", [64, 4096, 65_536])
@pytest.mark.parametrize("inserted", [False, True])
def test_a_buffer_that_comes_twice_at_the_turn(length: int, inserted: bool) -> None:
    counts = sound().counts
    again = counts[TURN - length : TURN]
    torn = np.insert(counts, TURN, again, axis=0) if inserted else counts.copy()
    if not inserted:
        torn[TURN : TURN + length] = again
    check(analyse(of(torn), AnalysisSettings(fit_seconds=1.0)))


@pytest.mark.parametrize("pieces", [3, 30])
def test_a_recording_spliced_from_pieces(pieces: int) -> None:
    random = np.random.default_rng(pieces)
    cuts = np.sort(random.integers(1000, sound().samples - 1000, pieces))
    torn = np.concatenate([part[random.integers(1, 200) :] for part in np.split(sound().counts, cuts)])
    check(analyse(of(torn), AnalysisSettings(fit_seconds=1.0)))


def test_a_flight_without_samples_has_no_edges() -> None:
    nothing = np.empty(0)
    assert edges_of_short_flight(nothing, nothing, 1e-9, (0.0, 1e-3), (1e-3, 2e-3), bend=1) is None
