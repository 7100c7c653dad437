"""Joint fits of recordings of the independent simulated rig: the truth is within the stated error."""

import pytest

from analysis.inference.fit.shot_fit import fit_shots
from tests.analysis.diagnosis.shots import shots
from tests.bench.blind import drawn

NAMES = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
SIGMAS = 4.5
STRONG = {  # a residual signal-to-noise of about a hundred over three shots, or more
    "demodulation_lag": {"time_s": 9.39e-6},
    "sensor_drift": {"ramp_m_per_s2": 1e-4},
    "cyclic_error": {"amplitude_m": 8e-10, "order": 2.0},
}


@pytest.mark.parametrize("name", STRONG)
def test_what_the_sensor_adds_is_found_and_leaves_the_rig_alone(name: str) -> None:
    truth = drawn((), 4, shots=2)
    fit = fit_shots(shots({name: STRONG[name]}, seed=4, count=2), effects=(name,))
    assert fit.converged
    assert fit.reduced_chi2 == pytest.approx(1.0, abs=0.06)
    for key, value in STRONG[name].items():
        found = fit.parameters[f"{name}.{key}"]
        assert abs(found.value - value) <= SIGMAS * found.std
    for key in NAMES:
        assert abs(fit.parameters[key].value - getattr(truth.bodies, key)) < SIGMAS * fit.parameters[key].std
    for one, speed in zip(fit.shots, truth.speeds_m_per_s, strict=True):
        assert abs(one.velocity_in_m_per_s.value + speed) < SIGMAS * one.velocity_in_m_per_s.std


def test_a_second_mode_that_the_base_has_swallowed_is_found() -> None:
    mode = {"mass_kg": 0.01, "frequency_hz": 2500.0, "damping_ratio": 0.01}
    fit = fit_shots(shots({"second_plate_mode": mode}, seed=4, count=2), effects=("second_plate_mode",))
    assert fit.converged
    for key, value in mode.items():
        found = fit.parameters[f"second_plate_mode.{key}"]
        assert abs(found.value - value) < SIGMAS * found.std < 0.3 * value
