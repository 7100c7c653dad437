"""What a motion, an impact and a plate are taken to be where nothing else is stated."""

import math
from dataclasses import fields

import numpy as np
import pytest

from analysis.shot.impact import Disturbance, KineticCor
from analysis.shot.motion import ARRAYS, Motion
from analysis.shot.plate import PlateTolerance
from analysis.shot.plates_of_set import describe_weights
from analysis.shot.quantity import NotSeen, Quantity, display_unit
from analysis.shot.recording import DEFAULT_WAVELENGTH_AIR_M, Setup


def test_a_motion_without_more_has_no_optics_no_trigger_and_no_fault_and_cannot_be_written_to() -> None:
    arrays = [np.zeros(3) for _ in range(9)]
    motion = Motion(*arrays, np.ones(3, np.bool_), 1e5, 1e4, 3e4, 0.02, 1e-6, None)
    assert motion.rest_frequency_hz == NotSeen("no optics")
    rest = {field.name: getattr(motion, field.name) for field in fields(Motion)[17:]}
    assert rest == {
        "trigger_time_s": None, "rate_error": 0.0, "reference": None,
        "measurement": None, "flags": (), "force_measured": False, "plate": None,
    }  # fmt: skip
    assert len(ARRAYS) == 10
    for name in ARRAYS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(motion, name)[0] = 1
    assert Setup(0.02) == Setup(0.02, 0.0, None, None, None, None, None, 16, None, {})
    assert DEFAULT_WAVELENGTH_AIR_M == 632.8e-9


def test_what_was_not_read_is_said_so_and_nothing_disturbs_by_itself() -> None:
    kinetic = KineticCor()
    assert {getattr(kinetic, field.name) for field in fields(KineticCor)} == {NotSeen("not read")}
    calm = Disturbance((), 1e-9, 2e-6)
    assert (calm.knocks_s, dict(calm.shares), calm.vibration) == ((), {}, None)


def test_a_plate_is_measured_by_calliper_and_micrometer_where_nothing_is_said() -> None:
    known = PlateTolerance()
    calliper = 0.05e-3 / math.sqrt(3.0)
    assert (known.arm_length_m, known.arm_width_m, known.disc_diameter_m) == pytest.approx(3 * (calliper,))
    assert known.thickness_m == pytest.approx(calliper / 10.0)
    assert known.density_kg_m3 / 8510.0 == pytest.approx(5e-3) and known.youngs_modulus_pa / 131e9 == pytest.approx(
        2e-2
    )
    assert known.beam_theory == 1e-2


@pytest.mark.parametrize(
    ("unit", "shown"),
    [
        ("s", (1e3, "ms")),
        ("m", (1e3, "mm")),
        ("kg", (1e3, "g")),
        ("Pa", (1e-9, "GPa")),
        ("1", (1.0, "")),
        ("N", (1.0, "N")),
    ],
)
def test_a_unit_is_shown_by_a_factor_and_a_name(unit: str, shown: tuple[float, str]) -> None:
    assert display_unit(unit) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "(0.0 ± 1.0)e-4"), (0.0101, "0.01010 ± 0.00010"), (0.0099, "(9.90 ± 0.10)e-3"),
        (-0.0099, "(-9.90 ± 0.10)e-3"), (99_999.0, "99999.00000 ± 0.00010"),
        (100_001.0, "(1.0000100000 ± 0.0000000010)e5"),
    ],
)  # fmt: skip
def test_in_a_sentence_a_number_has_a_power_of_ten_below_a_hundredth_and_from_a_hundred_thousand(
    value: float, shown: str
) -> None:
    assert Quantity(value, 1e-4).in_text() == shown
    assert Quantity(2.0, 0.5, "how").scaled(-3.0) == Quantity(-6.0, 1.5, "how")


@pytest.mark.parametrize(("apart_kg", "told"), [(0.9e-6, False), (1.1e-6, True)])
def test_weights_that_differ_by_less_than_a_milligram_are_one(apart_kg: float, told: bool) -> None:
    words = describe_weights([0.018, 0.018 + apart_kg])
    assert words == ("shots 1 as found, 2 with 0.00 g added" if told else "")
    assert describe_weights([0.068, 0.018, 0.018 + 0.9e-6]) == "shots 1 with 50.00 g added, 2-3 as found"
