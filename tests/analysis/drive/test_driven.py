"""Diagnosis of driven sliders: simulated ones of known truth, and the EMPS benchmark where it is present."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.driven import diagnose_driven
from analysis.diagnosis.findings.result import Diagnosis, Verdict
from analysis.diagnosis.findings.wording import in_words, remark_on
from analysis.drive.bandwidth import _equal_noise_hz, force_noise
from analysis.drive.catalogue import LAWS
from analysis.drive.curves import drive_curves
from analysis.drive.driven_fit import fit_driven
from analysis.drive.law_screening import _ripple_pitches, project_out, screen_laws
from analysis.drive.regression import independent_count, regress
from analysis.drive.repeatability import Repeatability, repeatability_of
from analysis.drive.stretch import Table, low_pass, prepare
from analysis.inference import orthonormal
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisError
from analysis.signal.filters import derivative_filters
from analysis.signal.record import motion_from_displacement
from instrument.files.motion_file import read_motion
from tests.analysis.drive.slider import MASS, OFFSET, RATE_HZ, VISCOUS, Drive, Floats

TRUE_BASE = {"moving_mass_kg": MASS, "viscous_coefficient_n_s_per_m": VISCOUS, "offset_n": OFFSET}


def named(diagnosis: Diagnosis) -> set[str]:
    return {effect.name for effect in diagnosis.effects}


def friction(x: Floats, v: Floats) -> Floats:
    return 20.0 * np.sign(v)


def lagging(x: Floats, v: Floats) -> Floats:
    """Bristles integrated step by step; friction builds up over 2 mm."""
    nonlinear = np.empty(x.size)
    now = float(np.sign(v[0]))
    for i in range(x.size):
        for _ in range(20):
            now += (x[i] - x[max(0, i - 1)]) / 20.0 / 2e-3 * (1.0 - now * np.sign(v[i]))
        nonlinear[i] = now
    return 20.0 * nonlinear


def test_clean_is_adequate() -> None:
    diagnosis = diagnose_driven([Drive().motion()])
    assert diagnosis.verdict is Verdict.ADEQUATE
    assert diagnosis.effects == ()
    for name, true in TRUE_BASE.items():
        found = diagnosis.fit_before.parameters[name]
        assert abs(found.value - true) < 4.0 * found.std


@pytest.mark.parametrize(
    ("extra", "late_s", "true"),
    [
        (friction, 0.0, {"coulomb_friction.force_n": 20.0}),
        (lambda x, v: 150.0 * v * np.abs(v), 0.0, {"quadratic_drag.coefficient_n_s2_per_m2": 150.0}),
        (lambda x, v: 80.0 * x, 0.0, {"bearing_gradient.stiffness_n_per_m": 80.0}),
        (lambda x, v: 2e4 * x**3, 0.0, {"cubic_stiffness.coefficient_n_per_m3": 2e4}),
        (lambda x, v: -35.0 * np.abs(v), 0.0, {"directional_viscous_drag.coefficient_n_s_per_m": -35.0}),
        (lambda x, v: 2.0 * np.sin(2 * np.pi * x / 0.013), 0.0, {"position_ripple.pitch_m": 0.013}),
        (
            lambda x, v: (20.0 + 60.0 * x + 400.0 * x**2) * np.sign(v),
            0.0,
            {"place_dependent_friction.slope_n_per_m": 60.0, "place_dependent_friction.curvature_n_per_m2": 400.0},
        ),
        (
            lambda x, v: 20.0 * np.sign(v) * (1.0 - 0.6 * np.exp(-np.abs(v) / 0.02)),
            5e-3,  # a whole sample: what is sampled with corners is not known between samples
            {"coulomb_friction.force_n": 20.0, "stribeck_friction.force_n": -12.0, "drive_delay.time_s": 5e-3},
        ),
        (lagging, 0.0, {"coulomb_friction.force_n": 20.0, "presliding_friction.reach_m": 2e-3}),
    ],
)
def test_a_law_is_named_with_its_size(extra, late_s: float, true: dict[str, float]) -> None:  # type: ignore[no-untyped-def]
    diagnosis = diagnose_driven([Drive(extra, late_s).motion()])
    assert diagnosis.verdict is Verdict.EFFECT_FOUND, diagnosis.sentence
    wanted = {name.split(".")[0] for name in true}
    assert wanted <= named(diagnosis) <= wanted | {"coulomb_friction"}
    for name, value in true.items():
        found = diagnosis.fit_after.parameters[name]
        assert abs(found.value - value) < 5.0 * found.std + 0.02 * abs(value), (name, found)
    held = diagnosis.error_held_out_after
    assert held is not None
    assert held.force_rms_n < 1.5 * diagnosis.error_after.force_rms_n < diagnosis.error_before.force_rms_n


@pytest.mark.parametrize("share", [0.03, 0.1])
def test_the_bandwidth_is_where_mass_times_the_accelerations_noise_is_the_forces(share: float) -> None:
    motion = Drive(friction, seconds=8.0).motion()
    noise_n, gain = 2.0, derivative_filters(1.0, share).acceleration_gain
    noise_m = noise_n * np.sqrt(2.0 * share) / (MASS * gain * RATE_HZ**2)
    found = _equal_noise_hz(motion.displacement_m, motion.force_n, RATE_HZ, 0.02 * RATE_HZ, (noise_m, noise_n))
    assert share / 1.15 < found / RATE_HZ < share * 1.05  # on a grid of 12 %, with the mass as the drive shows it


@pytest.mark.parametrize("busy", [0.0, 100.0])
def test_the_noise_of_a_force_is_that_of_its_highest_frequencies_however_quickly_the_drive_changes(busy: float) -> None:
    """White noise of 1 N beside a drive that fills the lower two thirds of the band with so many newtons."""
    rate_hz, random = 1e3, np.random.default_rng(7)
    time_s = np.arange(8000) / rate_hz
    spectrum = np.fft.rfft(random.standard_normal(time_s.size))
    spectrum[np.fft.rfftfreq(time_s.size, 1 / rate_hz) > 330.0] = 0.0
    drive = busy * np.fft.irfft(spectrum, time_s.size)
    force = drive + random.standard_normal(time_s.size)
    motion = motion_from_displacement(time_s, 0.1 * np.sin(time_s), None, force, moving_mass_kg=1.0)
    assert force_noise(motion) == pytest.approx(1.0, rel=0.1)


def test_the_force_is_filtered_like_the_motion() -> None:
    """What drives the slider faster than the encoder can show is no error of the model."""
    fast = Drive(encoder_m=2e-6, waves=((0.08, 0.31), (0.03, 0.97), (0.008, 2.3), (2e-6, 60.0)))
    motion = fast.motion()
    assert MASS * 2e-6 * (2.0 * np.pi * 60.0) ** 2 / np.sqrt(2.0) > 15.0  # N rms of force, beyond what the encoder sees
    diagnosis = diagnose_driven([motion])
    assert diagnosis.verdict is Verdict.ADEQUATE
    assert diagnosis.error_after.force_rms_n < 1.5
    assert any("Hz" in words for words in in_words(diagnosis).blind_spots)


def test_motion_one_way_leaves_friction_undetermined() -> None:
    """One way, Coulomb friction is a constant force: no candidate, and no failure either."""
    motion = Drive(friction, steady_m_per_s=0.4).motion()
    assert (np.diff(motion.displacement_m) > 0.0).all()
    diagnosis = diagnose_driven([motion])
    assert diagnosis.verdict is Verdict.ADEQUATE
    remarks = {candidate.name: remark_on(candidate) for candidate in diagnosis.candidates}
    assert "not identifiable" in remarks["coulomb_friction"]
    assert "both ways" in in_words(diagnosis).separating_shot


def test_a_stated_mass_is_used() -> None:
    fit = fit_driven([Drive(mass_kg=95.2).motion()])
    assert fit.parameters["moving_mass_kg"].value == 95.2
    assert fit.flags == ()


def test_a_wrong_stated_mass_is_contradicted() -> None:
    motion = Drive(friction, mass_kg=80.0).motion()
    assert "mass_disagrees" in fit_driven([motion]).flags
    diagnosis = diagnose_driven([motion])
    assert "contradicted" in diagnosis.sentence
    mass = diagnosis.fit_after.parameters["moving_mass_kg"]
    assert abs(mass.value - MASS) < 4.0 * mass.std
    (gain,) = (c for c in diagnosis.candidates if c.name == "gain_error")
    fraction = gain.parameters["fraction"]
    assert fraction.value == pytest.approx(80.0 / MASS - 1.0, abs=0.01)
    assert gain.score == pytest.approx(abs(fraction.value) / fraction.std) and gain.score > 4.0


def test_the_scatter_between_cycles_is_the_repeatability() -> None:
    """A force that the model cannot give, the same in every cycle, is held against what the cycles repeat to."""

    def odd(x: Floats, v: Floats) -> Floats:
        return 4.0 * np.sign(np.sin(2 * np.pi * x / 0.05)) * np.sign(v)

    cycles = Drive(odd, waves=((0.08, 0.25), (0.03, 0.75), (0.008, 1.5)), seconds=16.0, noise_n=1.0)
    diagnosis = diagnose_driven([cycles.motion()])
    assert diagnosis.verdict in (Verdict.PARTLY_EXPLAINED, Verdict.UNEXPLAINED)
    assert "repeatability of its cycle of 4 s" in diagnosis.sentence
    assert "times the repeatability of its cycle" in in_words(diagnosis).remainder


def test_the_scatter_between_records_of_one_input_is_the_repeatability() -> None:
    """No cycle in any of them, but the same motion in all: what they repeat to is the yardstick, clocks apart."""

    def odd(x: Floats, v: Floats) -> Floats:
        return 4.0 * np.sign(np.sin(2 * np.pi * x / 0.05)) * np.sign(v)

    one, two = (Drive(odd, seconds=10.0, noise_n=1.0, seed=seed).motion() for seed in (1, 2))
    other = Drive(odd, seconds=10.0, noise_n=1.0, seed=3, waves=((0.07, 0.37), (0.03, 0.83))).motion()

    def repeatability(motions: list[Motion]) -> Repeatability:
        table = Table.of(prepare(motions))
        found = regress(table, ())
        return repeatability_of(table, found, 0.01)

    assert not repeatability([one, other]).repeats
    seen = repeatability([one, other, replace(two, time_s=two.time_s + 100.0)])
    assert seen.repeats and seen.cycle_s is None
    passed = float(np.linalg.norm(low_pass(RATE_HZ, prepare([one, other])[0].bandwidth_hz)))
    assert 0.8 * passed < seen.force_n < 1.2 * passed  # the noise of 1 N through the filter, not the 4 N of the odd law


def test_force_and_motion_pass_the_same_filter() -> None:
    """Without noise nothing is left: a filter flatter than the force's left 0.02 N of 60, told as a delay of 57 us."""
    motion = Drive(noise_n=1e-9, encoder_m=1e-12).motion()
    found = regress(Table.of(prepare([motion])))
    assert found.rms_n < 1e-5 * float(np.std(motion.force_n))
    assert found.values == pytest.approx([MASS, VISCOUS, OFFSET], rel=2e-5)


def test_quiet_records_count_for_little_beside_a_noisy_one() -> None:
    random = np.random.default_rng(4)
    record = np.repeat([0, 1, 2], 1000)

    def worth(noise: tuple[float, float, float]) -> float:
        draws = random.normal(0.0, np.repeat(noise, 1000), (40, 3000))
        return float(np.median([independent_count(left, record) for left in draws]))

    assert worth((1.0, 1.0, 1.0)) == pytest.approx(3000, rel=0.15)
    assert worth((0.1, 0.1, 3.0)) == pytest.approx(1000, rel=0.15)


def test_load_friction_is_no_candidate_in_motion_one_way() -> None:
    motion = Drive(seconds=12.0, steady_m_per_s=2.0, seed=3).motion()
    assert (motion.force_n > 0.0).all() and (np.diff(motion.displacement_m) > 0.0).all()
    screened = screen_laws((table := Table.of(prepare([motion]))), regress(table))
    assert "load_dependent_friction" in screened.unidentifiable
    assert diagnose_driven([motion]).verdict is Verdict.ADEQUATE


def test_pitches_that_are_searched_for_a_ripple_are_those_of_different_waves() -> None:
    pitches_m = (20e-3, 14e-3)
    motion = Drive(lambda x, v: 3.0 * np.sin(2 * np.pi * x / pitches_m[0]) + np.cos(2 * np.pi * x / pitches_m[1]))
    table = Table.of(prepare([motion.motion()]))
    found = regress(table)
    basis = orthonormal(found.tangents[found.mask])
    residual_n = project_out(basis, found.residual_n[found.mask][:, None])[:, 0]
    first, second, third = (pitch_m for (pitch_m,) in _ripple_pitches(table, found.mask, basis, residual_n))
    assert (first, second) == pytest.approx(pitches_m, rel=0.02)
    waves = np.ptp(table.displacement_m[found.mask]) / np.array([first, second, third])
    assert np.diff(np.sort(waves)).min() > 1.0  # along the travel: closer ones are one ripple


def test_the_accepted_laws_are_the_model() -> None:
    motion = Drive(friction).motion()
    fit = fit_driven([motion], ["coulomb_friction"])
    assert fit.effects == (LAWS["coulomb_friction"],)
    assert fit.parameters["coulomb_friction.force_n"].value == pytest.approx(20.0, abs=0.3)
    diagnosis = diagnose_driven([motion], ["coulomb_friction"])
    assert diagnosis.verdict is Verdict.ADEQUATE
    assert diagnosis.fit_after.effects == (LAWS["coulomb_friction"],)
    assert diagnosis.error_before.force_rms_n == pytest.approx(diagnosis.error_after.force_rms_n)


def test_refusals_name_the_cause() -> None:
    good = Drive(mass_kg=95.0).motion()
    place, force = good.displacement_m.copy(), good.force_n.copy()

    def refused(place: Floats, force: Floats | None, match: str) -> None:
        with pytest.raises(AnalysisError, match=match):
            diagnose_driven([motion_from_displacement(good.time_s, place, None, force, moving_mass_kg=95.0)])

    refused(place, None, "force_n: no such column")
    refused(-place, force, "sign of force_n or of displacement_m is reversed")
    refused(np.random.default_rng(1).normal(0.0, 1e-6, place.size), force, "no motion")
    refused(place, np.full(place.size, 3.0) + 0.0 * force, "force_n: constant at 3")
    with pytest.raises(AnalysisError, match="too short"):
        diagnose_driven([motion_from_displacement(good.time_s[:100], place[:100], None, force[:100], 95.0)])


def test_emps(measured: Path) -> None:
    """The published parameters lie within the stated uncertainty, and the half that took no part is foretold."""
    record = read_motion(measured / "emps.csv")
    motion = motion_from_displacement(
        record.time_s, record.displacement_m, None, record.force_n, moving_mass_kg=record.moving_mass_kg
    )
    diagnosis = diagnose_driven([motion])
    assert diagnosis.error_before.force_rms_n == pytest.approx(9.18, abs=0.1)
    assert diagnosis.error_held_out_after is not None
    assert diagnosis.error_held_out_after.force_rms_n < 1.25
    assert {"coulomb_friction", "directional_viscous_drag", "stribeck_friction", "drive_delay"} <= named(diagnosis)
    assert len(diagnosis.effects) <= 5
    after = diagnosis.fit_after.parameters
    assert abs(after["moving_mass_kg"].value - 95.11) < 4.0 * after["moving_mass_kg"].std
    # friction falls towards rest, which is not Stribeck's sign: the law is told as it is seen
    assert after["stribeck_friction.force_n"].value < -8.0
    assert "against Stribeck's sign" in diagnosis.sentence
    # what is left is far above what the cycle repeats to, and the diagnosis says so instead of claiming to be done
    assert diagnosis.verdict is Verdict.PARTLY_EXPLAINED
    assert "repeatability of its cycle of 6.24 s" in diagnosis.sentence


def test_the_curves_are_the_fits_own_force_and_break_where_nothing_was_compared() -> None:
    drive = Drive(friction, noise_n=0.0)
    motion = drive.motion()
    fit = fit_driven([motion], ("coulomb_friction",))
    told = drive_curves(motion, fit)
    left = float(np.sqrt(np.nanmean(told.residual_n**2)))
    assert left == pytest.approx(told.repeatability.force_n * np.sqrt(fit.reduced_chi2), rel=1e-6)
    away = np.abs(told.velocity_m_per_s) > 0.05  # where the filter does not round the reversal
    true = drive._force(told.time_s)
    for force in (told.measured_n, told.modelled_n):
        assert np.nanmedian(np.abs(force - true)[away]) < 0.01 * np.nanmax(np.abs(true))
    assert np.all(np.diff(told.time_s) > 0.0)
    held = motion.displacement_m.copy()
    held[1200:1500] = held[1200]  # it stands still
    still = drive_curves(motion_from_displacement(motion.time_s, held, None, motion.force_n, moving_mass_kg=None), fit)
    assert np.isnan(still.measured_n).any() and np.isfinite(still.time_s).all()
