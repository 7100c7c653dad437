"""The force of each law of a drive on a few samples, worked out by hand or by scipy, and what a share is worth."""

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.drive.catalogue import GAIN_ERROR, LAWS, ParameterScale, bristle_deflection, laws_named
from analysis.drive.stretch import Stretch
from analysis.shot.shot import AnalysisError

NONE = np.zeros(0)


def stretch(x: list[float], v: list[float], force: list[float] | None = None, used: list[int] | None = None) -> Stretch:
    """Return a stretch of these samples at 10 Hz, in a bandwidth of 2 Hz."""
    n = len(x)
    return Stretch(
        np.arange(n) / 10.0, np.array(x), np.array(v), np.zeros(n), np.array(force or [0.0] * n),
        np.array(used if used is not None else range(n)), 1, 10.0, 2.0, 0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("law", "nonlinear", "columns"),
    [
        ("coulomb_friction", (), [[-1, 0, 1]]),
        ("directional_viscous_drag", (), [[2, 0, 4]]),
        ("quadratic_drag", (), [[-4, 0, 16]]),
        ("stribeck_friction", (2.0,), [[-np.exp(-1.0), 0, np.exp(-2.0)]]),
        ("place_dependent_friction", (), [[-0.5, 0, 3], [-0.25, 0, 9]]),
        ("load_dependent_friction", (), [[-7, 0, 5]]),
        ("bearing_gradient", (), [[0.5, 1, 3]]),
        ("quadratic_stiffness", (), [[0.25, 1, 9]]),
        ("cubic_stiffness", (), [[0.125, 1, 27]]),
        ("position_ripple", (4.0,), [[np.sqrt(0.5), 1, -1], [np.sqrt(0.5), 0, 0]]),
    ],
)
def test_the_force_of_a_law(law: str, nonlinear: tuple[float, ...], columns: list[list[float]]) -> None:
    force = LAWS[law].force
    assert force is not None
    found = force(stretch([0.5, 1.0, 3.0], [-2.0, 0.0, 4.0], [7.0, -6.0, -5.0]), nonlinear)
    assert len(found) == len(LAWS[law].linear_names) == len(columns)
    np.testing.assert_allclose(np.stack(found), columns, atol=1e-12)


def test_friction_that_builds_up_lags_by_two_after_a_reversal_and_less_by_e_with_every_reach() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 41), np.linspace(0.975, 0.0, 40)])
    v = np.where(np.arange(x.size) < 41, 3.0, -3.0)
    force = LAWS["presliding_friction"].force
    assert force is not None
    (lag,) = force(stretch(x.tolist(), v.tolist()), (0.2,))
    np.testing.assert_allclose(lag[:41], 0.0, atol=1e-12)
    np.testing.assert_allclose(lag[41:], 2.0 * np.exp(-(1.0 - x[41:]) / 0.2), rtol=1e-12)


def test_bristles_bend_as_their_differential_equation_says() -> None:
    time = np.linspace(0.0, 3.0, 30_001)
    x, v = 0.01 * np.sin(2.0 * time), 0.02 * np.cos(2.0 * time)
    reach, speed, excess = 2e-3, 8e-3, 0.7
    force = LAWS["lugre_friction"].force
    assert force is not None
    (lag,) = force(stretch(x.tolist(), v.tolist()), (reach, speed, excess))

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        now = 0.02 * np.cos(2.0 * t)
        level = 1.0 + excess * np.exp(-((now / speed) ** 2))
        return np.asarray(now * (1.0 - z * np.sign(now) / level) / reach)

    begin = [1.0 + excess * np.exp(-((v[0] / speed) ** 2))]
    true = solve_ivp(rate, (0.0, 3.0), begin, t_eval=time[::500], rtol=1e-8, atol=1e-10, max_step=1e-3).y[0]
    np.testing.assert_allclose((lag + np.sign(v))[::500], true, atol=2e-3)


def test_bristles_that_rest_at_first_begin_as_in_the_first_motion() -> None:
    level = np.array([9.0, 2.0, 3.0])
    bent = bristle_deflection(np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, -1.0]), level, 0.5)
    assert bent == pytest.approx([-2.0, -2.0, -3.0 + np.exp(-1.0 / 1.5)])


@pytest.mark.parametrize(
    ("scale", "worth"),
    [
        (ParameterScale.SPEED, 4.0),
        (ParameterScale.TRAVEL, 2.0),
        (ParameterScale.PITCH, 2.0),
        (ParameterScale.TIME, 0.5),
        (ParameterScale.NUMBER, 1.0),
    ],
)
def test_a_share_is_worth_the_most_that_any_stretch_shows_in_the_samples_compared(
    scale: ParameterScale, worth: float
) -> None:
    one = stretch([0.0, 1.0, 3.0, 90.0], [1.0, 2.0, -3.0, 90.0], used=[1, 2])
    two = stretch([5.0, 4.0, 6.0, 5.5], [-4.0, 0.0, 1.0, -90.0], used=[0, 1, 2])
    parameter = next(p for law in LAWS.values() for p in law.nonlinear_parameters if p.share_of is scale)
    assert parameter.scale_in([one, two]) == parameter.scale_in([two, one]) == worth


def test_laws_are_found_by_their_names_or_themselves_and_nothing_else_is_one() -> None:
    assert laws_named(["drive_delay", LAWS["cubic_stiffness"]]) == (LAWS["drive_delay"], LAWS["cubic_stiffness"])
    with pytest.raises(AnalysisError, match=r"called 'gain_error'; there are coulomb_friction, .*, drive_delay$"):
        laws_named(["coulomb_friction", "gain_error"])
    assert [law.name for law in LAWS.values() if law.of_force] == ["load_dependent_friction"]
    for name, law in LAWS.items():
        names = [f"{name}.{parameter.name}" for parameter in law.parameters]
        assert names == [*law.linear_names, *law.nonlinear_names]
        assert law.name == name and f"{name}.{law.amplitude}" == names[0]
        assert law.values_in(dict(zip(names, range(9), strict=False))) == tuple(
            range(len(names))[len(law.linear_names) :]
        )


def test_a_law_is_sent_to_another_process_by_its_name() -> None:
    sent = pickle.loads(pickle.dumps(tuple(LAWS.values())))
    assert all(one is other for one, other in zip(sent, LAWS.values(), strict=True))


def test_the_first_values_that_are_tried_lie_within_the_bounds_and_rise() -> None:
    for parameter in (p for law in LAWS.values() for p in law.nonlinear_parameters):
        tried = [parameter.lower, *parameter.grid, parameter.upper]
        assert tried == sorted(tried) and len(set(tried)) == len(tried), parameter.name
        assert not parameter.logarithmic or parameter.lower > 0.0
    (delay,) = LAWS["drive_delay"].nonlinear_parameters
    assert 0.0 in delay.grid and delay.grid == pytest.approx([-share for share in reversed(delay.grid)])


def test_laws_have_words_and_the_one_of_the_force_is_told_by_its_own() -> None:
    said = {name: law.words for name, law in LAWS.items() if law.words != name.replace("_", " ")}
    assert said == {
        "directional_viscous_drag": "direction-dependent viscous drag", "stribeck_friction": "Stribeck friction",
        "lugre_friction": "LuGre friction", "position_ripple": "a ripple along the travel",
        "place_dependent_friction": "position-dependent friction", "load_dependent_friction": "load-dependent friction",
        "quadratic_stiffness": "an asymmetric spring", "drive_delay": "a delay between force and motion",
    }  # fmt: skip
    assert GAIN_ERROR.name == "gain_error" not in LAWS and GAIN_ERROR.words == "an error of the force's scale"
    assert [p.unit for p in LAWS["quadratic_drag"].parameters] == ["N s²/m²"] and GAIN_ERROR.parameters[0].unit == ""
