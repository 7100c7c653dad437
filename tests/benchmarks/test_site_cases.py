"""How far an effect stands out of a building: a property of the rig, the site and the effect alone."""

from dataclasses import replace

import pytest

from analysis.inference.model.samples import averaged_shots
from tests.benchmarks import site_cases
from tests.benchmarks.site_cases import Case, draw, norms


def test_an_effect_is_scaled_to_the_norms_asked_for_even_where_its_response_is_not_in_proportion() -> None:
    truth, size = draw(Case("VC-A", "cubic_stiffness", 9996030028, 15.0))
    assert size == pytest.approx(15.0, rel=0.03)
    assert norms(truth) == pytest.approx(size, rel=1e-6)


def test_the_norms_do_not_depend_on_where_a_reading_puts_the_touch(monkeypatch: pytest.MonkeyPatch) -> None:
    # at VC-A the frame's directions 10 us from the model's bounces would leave three times the effect's true norm
    truth, size = draw(Case("VC-A", "bearing_gradient", 9995029989, 15.0))
    plain = averaged_shots

    def read_late(motions):  # type: ignore[no-untyped-def]
        shots = plain(motions)
        return [replace(s, course=replace(s.course, touch_time_s=s.course.touch_time_s + 30e-6)) for s in shots]

    monkeypatch.setattr(site_cases, "averaged_shots", read_late)
    assert norms(truth) == pytest.approx(size, rel=1e-6)
