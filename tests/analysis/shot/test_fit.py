"""A fit of several shots on several plates, as it applies to one of them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.shot.fit import Fit, count_plates, names_on_plate
from analysis.shot.quantity import Quantity

NAMES = ("plate_stiffness_n_per_m", "plate_2_stiffness_n_per_m", "contact_damping_n_s_per_m", "plate_2_mass_kg",
         "plate_3_mass_kg")  # fmt: skip


def fit_of(names: tuple[str, ...]) -> Fit:
    parameters = {name: Quantity(float(k), float(k + 1)) for k, name in enumerate(names)}
    matrix = np.random.default_rng(1).standard_normal((len(names), len(names)))
    shots = tuple(cast(Any, SimpleNamespace(plate_number=k, reduced_chi2=1.0 + k)) for k in (1, 0))
    return Fit("paper", parameters, matrix @ matrix.T, shots, 5.0, 1e-10, True)


def test_further_plates_are_told_by_their_numbers() -> None:
    assert count_plates(NAMES) == 3
    assert count_plates(NAMES[:1]) == 1 == count_plates(()) and count_plates(NAMES[:4]) == 2
    plain = {"plate_stiffness_n_per_m": "plate_stiffness_n_per_m", "contact_damping_n_s_per_m": NAMES[2]}
    assert names_on_plate(NAMES, 0) == plain
    assert names_on_plate(NAMES, 1) == plain | {"plate_stiffness_n_per_m": NAMES[1], "plate_mass_kg": NAMES[3]}
    assert names_on_plate(NAMES, 2) == plain | {"plate_mass_kg": NAMES[4]}


def test_on_a_plate_a_fit_has_the_parameters_and_covariance_that_apply_there() -> None:
    fit = fit_of(NAMES)
    second = fit.on_plate(1)
    assert list(second.parameters) == ["plate_stiffness_n_per_m", "contact_damping_n_s_per_m", "plate_mass_kg"]
    assert [q.value for q in second.parameters.values()] == [1.0, 2.0, 3.0]
    assert np.array_equal(second.covariance, fit.covariance[np.ix_([1, 2, 3], [1, 2, 3])])
    alone = fit_of(NAMES[:1])
    assert alone.on_plate(0) is alone
    one = fit.of_shot(0)
    assert one.shots == (fit.shots[0],) and one.reduced_chi2 == 1.0 + fit.shots[0].plate_number == 2.0
    assert one.parameters == second.parameters
    assert list(fit.of_shot(1).parameters) == ["plate_stiffness_n_per_m", "contact_damping_n_s_per_m"]


def test_correlations_are_covariances_over_both_deviations_and_unknown_without_one() -> None:
    covariance = np.array([[4.0, -3.0, 0.0], [-3.0, 9.0, 1.0], [0.0, 1.0, 0.0]])
    found = replace(fit_of(NAMES[:3]), covariance=covariance).correlations
    assert found[:2, :2] == pytest.approx(np.array([[1.0, -0.5], [-0.5, 1.0]]))
    assert np.isnan(found[2]).all() and np.isnan(found[:, 2]).all()
    endless = replace(fit_of(NAMES[:2]), covariance=np.diag([1.0, np.inf])).correlations
    assert endless[0, 0] == 1.0 and np.isnan(endless[1]).all()


def test_a_parameter_of_a_law_is_named_by_the_law_and_not_by_its_whole_key() -> None:
    law = cast(Any, SimpleNamespace(key="law {long}", name="law", parameters=(SimpleNamespace(name="c_n"),)))
    fit = replace(fit_of(("plate_mass_kg", "law {long}.c_n")), effects=(law,))
    assert fit.short_names == {"plate_mass_kg": "plate_mass_kg", "law {long}.c_n": "law.c_n"}
