"""The plots of a shot, by the names under which their notes are kept."""

import pytest

from analysis.shot.shot import PLOT_UNITS

OF_QUANTITY = {"velocity": "m/s", "speed": "m/s", "force": "N", "deflection": "m", "position": "m"}


@pytest.mark.parametrize("plot", PLOT_UNITS)
def test_a_note_is_placed_in_the_units_of_the_plots_own_axes(plot: str) -> None:
    """A plot "force vs speed" has the force upwards; a spectrum has its frequency along, a spectrogram upwards."""
    up, _, along = plot.removeprefix("residual of ").partition(" vs ")
    x_unit, y_unit = PLOT_UNITS[plot]
    assert x_unit == ("Hz" if plot == "spectrum" else OF_QUANTITY.get(along, "s"))
    if up in OF_QUANTITY:
        assert y_unit == OF_QUANTITY[up]
    assert (y_unit == "Hz") == (plot == "spectrogram")
