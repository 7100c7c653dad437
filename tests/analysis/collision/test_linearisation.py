"""The instants on which a path is solved, and the order of its steps."""

import numpy as np

from analysis.collision.linearisation import _lay_instants


def test_steps_before_the_start_run_backwards_and_their_instants_forwards() -> None:
    """Two steps lead from the start at 0 back to -3, two lead on to 5, of two, four, two and six instants."""
    begin, end = np.array([0.0, -1.0, 0.0, 2.0]), np.array([-1.0, -3.0, 2.0, 5.0])
    halves = np.array([1, 2, 1, 3])
    instants, place = np.full(15, np.nan), np.full(4, -1)
    _lay_instants(begin, end, halves, 2, instants, place)
    assert instants.tolist() == [-3.0, -2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0]
    assert instants[place].tolist() == begin.tolist()
