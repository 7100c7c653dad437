"""A recording's times, channels and gaps, and a rig whose stated values were corrected."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.recording import MAX_GAPS, SETUP_KEYS, Air, Channel, Gap, Recording, Role, Setup, corrected_setup

COUNTS = np.zeros((1000, 3), np.int16)
CHANNELS = (Channel(Role.SWITCH, 1e-3), Channel(Role.MEASUREMENT, 1e-4), Channel(Role.REFERENCE, 1e-4))
PLAIN = Recording("r", COUNTS, 2e6, CHANNELS, Setup(0.018), trigger_sample=500)


def test_samples_count_per_channel_and_the_trigger_in_seconds() -> None:
    assert (PLAIN.samples, PLAIN.trigger_time_s) == (1000, 2.5e-4)
    assert replace(PLAIN, trigger_sample=0).trigger_time_s == 0.0
    assert replace(PLAIN, trigger_sample=None).trigger_time_s is None


def test_a_channel_is_found_by_its_role() -> None:
    assert [PLAIN.column(role) for role in (Role.SWITCH, Role.MEASUREMENT, Role.REFERENCE)] == [0, 1, 2]
    alone = replace(PLAIN, channels=CHANNELS[:2])
    assert alone.column(Role.REFERENCE) is None and alone.column(Role.SWITCH) == 0


def test_gaps_inside_a_recording_that_lost_samples_are_bridged_in_order() -> None:
    gaps = (Gap(700, 3), Gap(1, 2), Gap(999, None), Gap(0, 5), Gap(1000, 5), Gap(300, 0))
    assert replace(PLAIN, gaps=gaps).bridgeable_gaps == (Gap(1, 2), Gap(700, 3), Gap(999, None))


def test_losses_beyond_the_samples_there_are_count_as_of_unknown_length() -> None:
    gaps = (Gap(100, 600), Gap(200, 400), Gap(300, 1), Gap(400, None))
    found = replace(PLAIN, gaps=gaps).bridgeable_gaps
    assert found == (Gap(100, 600), Gap(200, 400), Gap(300, None), Gap(400, None))


@pytest.mark.parametrize("count", [MAX_GAPS, MAX_GAPS + 1])
def test_of_more_than_three_hundred_gaps_no_length_is_known(count: int) -> None:
    assert MAX_GAPS == 300
    found = replace(PLAIN, gaps=tuple(Gap(k + 1, 1) for k in range(count))).bridgeable_gaps
    assert len(found) == count and {gap.samples_lost for gap in found} == {1 if count <= 300 else None}


def test_a_rigs_values_are_corrected_one_by_one_and_the_air_as_a_whole() -> None:
    setup = Setup(0.018, 1e-6, 633e-9, 632.8e-9, Air(20.0, 1e5, 50.0), 2.7e6, extra={"x": 1})
    assert corrected_setup(setup, {}) == setup
    assert corrected_setup(setup, {"moving_mass_kg": 0.02, "wavelength_air_m": None}) == replace(
        setup, moving_mass_kg=0.02, wavelength_air_m=None
    )
    air = {"temperature_c": 21.0, "pressure_pa": 1.01e5, "humidity_percent": 40.0}
    assert corrected_setup(setup, air).air == Air(21.0, 1.01e5, 40.0)
    assert corrected_setup(setup, air | {"humidity_percent": None}).air is None
    assert corrected_setup(setup, {"temperature_c": 21.0}).air == setup.air  # a part of it is none
    assert {"temperature_c", "rest_frequency_hz"} < set(SETUP_KEYS)
    with pytest.raises(KeyError, match="colour"):
        corrected_setup(setup, {"moving_mass_kg": 0.02, "colour": 1.0})
