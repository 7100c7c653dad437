"""The parameters of a base model over one plate and several, and the collision that they make."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.parameters import PAPER, Infeasible, Variant
from analysis.inference.model import base as module
from analysis.inference.model.base import OneBodyOnContact, TwoBodies, base_named, named_on_plate, start_from_fit
from levimass import BASE_MODELS, base_model

SHARED = np.array([200.0, 2e-4, 1e4, 0.4, 300.0, 3e-4, 400.0, 4e-4])
THREE = TwoBodies(Variant.CLAMPED, plates=3)
ALONE = OneBodyOnContact()


def test_the_parameters_of_several_plates_on_one_contact() -> None:
    assert THREE.names == (
        "plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m",
        "plate_2_stiffness_n_per_m", "plate_2_mass_kg", "plate_3_stiffness_n_per_m", "plate_3_mass_kg",
    )  # fmt: skip
    assert THREE.further_at == (4, 6) and THREE.contact_at == slice(2, 4)
    assert [THREE.places(k) for k in range(3)] == [(0, 1, 2, 3), (4, 5, 2, 3), (6, 7, 2, 3)]
    assert THREE.columns(2) == {
        "plate_3_stiffness_n_per_m": 0, "plate_3_mass_kg": 1, "contact_stiffness_n_per_m": 2,
        "contact_damping_n_s_per_m": 3,
    }  # fmt: skip
    assert ALONE.names == THREE.names[2:4] and ALONE.contact_at == slice(0, 2) and ALONE.further_at == ()
    assert ALONE.places(0) == (0, 1) and ALONE.columns(0) == {ALONE.names[0]: 2, ALONE.names[1]: 3}
    assert named_on_plate("plate_mass_kg", 0) == "plate_mass_kg"
    assert named_on_plate("plate_of_plate_kg", 1) == "plate_2_of_plate_kg"


def test_a_collision_is_that_of_the_shots_plate() -> None:
    second = THREE.collision(SHARED, -0.2, 0.02, (1e-6, 2e-6), 1)
    np.testing.assert_array_equal(second.vector, [300.0, 3e-4, 1e4, 0.4, -0.2, 1e-6, 2e-6, 0.02])
    assert second.variant is Variant.CLAMPED
    first = THREE.collision(SHARED, -0.2, 0.02)
    np.testing.assert_array_equal(first.vector, [200.0, 2e-4, 1e4, 0.4, -0.2, 0.0, 0.0, 0.02])
    locked = ALONE.collision(SHARED[2:4], -0.2, 0.02)
    assert (locked.plate_stiffness_n_per_m, locked.plate_mass_kg) == (0.0, math.inf)
    assert (locked.contact_stiffness_n_per_m, locked.contact_damping_n_s_per_m) == (1e4, 0.4)
    with pytest.raises(Infeasible, match="towards the plate"):
        THREE.collision(SHARED, 0.2, 0.02)
    np.testing.assert_array_equal(TwoBodies(Variant.PAPER).shared(PAPER), PAPER.vector[:4])
    np.testing.assert_array_equal(ALONE.shared(PAPER), PAPER.vector[2:4])


def test_a_base_model_has_a_name() -> None:
    assert base_named("contact") == ALONE and base_named("clamped") == TwoBodies(Variant.CLAMPED)
    assert base_named("paper").variant is Variant.PAPER and base_named("no_tension").variant is Variant.NO_TENSION
    for name in ("x", "driven"):
        with pytest.raises(ValueError, match=f"no base model '{name}'; there are paper, clamped, no_tension, contact$"):
            base_named(name)
    assert list(module._BASES) == [name for name in BASE_MODELS if base_model(name).collides]
    assert base_model("x").words == "x" and base_model("x").collides
    assert base_named("contact").on_plates(3) == ALONE and base_named("clamped").on_plates(3) == THREE


def test_a_search_begins_where_a_fit_of_the_shots_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "plate_count", lambda motions: len(set(motions)))
    motions: Any = list("abcb")
    base = base_named("clamped").on_plates(3)
    numbers = {name: SimpleNamespace(value=10.0 + k) for k, name in enumerate(base.names)}
    own = [
        SimpleNamespace(**{
            name: SimpleNamespace(value=k + part)
            for name, part in (("velocity_in_m_per_s", 0.1), ("touch_time_s", 0.2), ("offset_m", 0.3))
        })
        for k in range(4)
    ]  # fmt: skip
    fit: Any = SimpleNamespace(
        model="clamped", parameters={**numbers, "viscous_drag.coefficient": None}, shots=own, reduced_chi2=3.5
    )
    begin = start_from_fit(fit, motions)
    assert begin.base == base and begin.shared.tolist() == [10.0 + k for k in range(8)]
    np.testing.assert_allclose(begin.own, np.arange(4)[:, None] + np.array([0.1, 0.2, 0.3]))
    assert begin.left == 3.5 and begin.plates == ()
    assert begin.point.values == ({},) * 4 and begin.point.base is begin.shared and begin.point.own is begin.own
