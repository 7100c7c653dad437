"""The scorer of the closed loop: known outcomes give known scores, and a whole case runs through."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtri

from analysis.shot.quantity import Quantity
from tests.benchmarks.loop_cases import Case, Outcome, cases, draw, judge, motions
from tests.benchmarks.loop_page import confusion, page
from tests.benchmarks.loop_score import Share, exact, lines, named_alone, truth_reported

TILT = Case("single", ("tilt",), 20.0, "white", 11)


def _outcome(case=TILT, named=("tilt",), classes=((),), verdict="effect_found", **more):
    return Outcome(case, 20.0, verdict, named, classes, **more)


def test_wilson_bounds_of_the_textbook():
    assert Share(10, 10).bounds == pytest.approx((0.7225, 1.0), abs=1e-4)
    assert Share(0, 300).bounds == pytest.approx((0.0, 0.01264), abs=1e-5)
    assert Share(95, 100).bounds == pytest.approx((0.8882, 0.9785), abs=1e-4)


def test_what_counts_as_exact_and_as_reported():
    assert exact(_outcome()) and truth_reported(_outcome())
    in_class = _outcome(named=("sensor_drift",), classes=(("tilt",),))
    assert not exact(in_class) and truth_reported(in_class) and not named_alone(in_class)
    wrong = _outcome(named=("sensor_drift",))
    assert not exact(wrong) and not truth_reported(wrong) and named_alone(wrong)
    more = _outcome(named=("tilt", "adhesion"), classes=((), ()))
    assert not exact(more) and truth_reported(more)
    silent = _outcome(named=(), classes=(), verdict="unexplained")
    assert not exact(silent) and not truth_reported(silent)
    removed = _outcome(named=(), classes=(), verdict="adequate", removed=("tilt",))
    assert not exact(removed) and truth_reported(removed)


def test_figures_say_when_a_target_is_missed():
    good = [_outcome() for _ in range(60)]
    bad = [_outcome(named=(), classes=(), verdict="adequate") for _ in range(40)]

    def met(outcomes):
        return next(line.met for line in lines(outcomes) if line.what == "one effect, exact name")

    assert met(good) and met(good + bad) is False
    assert met([]) is None and met(good[:10]) is False  # ten of ten do not show a lower bound of 90 %


def test_an_effect_that_nobody_could_tell_is_scored_apart():
    near = [_outcome(named=("sensor_drift",), classes=(("tilt",),), nearest="sensor_drift", apart=1.0)] * 60
    alone = [_outcome(named=("sensor_drift",), nearest="sensor_drift", apart=1.0)] * 10
    far = [_outcome(nearest="sensor_drift", apart=9.0)] * 80

    def judged(outcomes):
        return {line.what: line.met for line in lines(outcomes)}

    told = "one effect, exact name, where it can be told"
    fair = "one effect, look-alike too near: no lone wrong name"
    assert judged(far + near)[told] and judged(far + near)[fair]
    assert judged(far + alone)[told] and not judged(far + alone)[fair]


def test_perfect_estimates_sit_on_the_bound():
    some = []
    for quantile in (np.arange(500) + 0.5) / 500:
        value = 1e-4 + 1e-6 * ndtri(quantile)
        some.append(
            _outcome(
                truth={"tilt": {"angle_rad": 1e-4}},
                found={"tilt": {"angle_rad": (value, 1e-6)}},
                bound={"tilt": {"angle_rad": 1e-6}},
                held_out=(3e-10, 1.001e-10),
                noise_m=1e-10,
            )
        )
    judged = {line.what: line for line in lines(some)}
    assert judged["95 % intervals cover"].met and judged["held-out excess error, after / before"].met
    assert judged["error over Cramer-Rao bound, 68 % quantile"].met
    wide = [replace(o, found={"tilt": {"angle_rad": (1.1e-4, 1e-6)}}) for o in some]
    judged = {line.what: line for line in lines(wide)}
    assert judged["95 % intervals cover"].met is False


def test_confusion_and_misses_are_published():
    outcomes = [
        _outcome(),
        _outcome(named=("sensor_drift",)),
        _outcome(Case("clean", (), 0.0, "floor", 3), (), (), "adequate"),
        _outcome(Case("beyond", ("magnet",), 20.0, "white", 5), (), (), "unexplained"),
    ]
    rows, columns, counts = confusion(outcomes)
    tilt = dict(zip(columns, counts[rows.index("tilt")], strict=True))
    assert tilt["tilt"] == 1 and tilt["sensor_drift"] == 1
    assert counts[rows.index("nothing")][columns.index("adequate")] == 1
    text = page(outcomes, "make bench-loop")
    assert "| single | tilt | 20 | white | 11 | sensor_drift |" in text and "magnet | 20" not in text


def test_cases_are_all_there_and_reproducible():
    runs = {"clean": 2, "single": 1, "natural": 1, "pair": 3, "beyond": 1, "raw": 2}
    some = cases(runs, 1)
    assert some == cases(runs, 1) and len({case.seed for case in some}) == len(some)
    kinds = [case.kind for case in some]
    assert [kinds.count(k) for k in runs] == [8, 19, 19, 3, 6, 6]


@pytest.mark.slow
def test_a_case_runs_from_draw_to_outcome():
    seen = []

    def oracle(shown):
        seen.extend(shown)
        error = SimpleNamespace(displacement_rms_m=1e-10)
        effect = SimpleNamespace(
            name="tilt",
            parameters={"angle_rad": Quantity(1e-4, 1e-6)},
            indistinguishable_from=(SimpleNamespace(name="sensor_drift"),),
        )
        return SimpleNamespace(
            verdict="effect_found", effects=(effect,), error_held_out_before=error, error_held_out_after=error
        )

    outcome = judge(TILT, oracle)
    assert outcome.snr == pytest.approx(20.0, rel=0.06)
    # An attraction that reaches further than the block flies is such a tilt with the other sign.
    assert outcome.nearest != "adhesion" and 5.0 < outcome.apart < outcome.snr
    assert outcome.named == ("tilt",) and outcome.classes == (("sensor_drift",),)
    assert set(outcome.bound["tilt"]) == {"angle_rad"} and outcome.bound["tilt"]["angle_rad"] > 0
    assert len(seen) == 3 and seen[0].displacement_std_m[0] == pytest.approx(1e-10)
    assert np.nanstd(seen[0].velocity_m_per_s[10:800]) < 1e-4

    def broken(shown):
        raise RuntimeError("no minimum")

    assert judge(TILT, broken).verdict == "failed"


@pytest.mark.parametrize("raw", ["eight_bit", "low_light", "no_reference"])
def test_noise_of_sets_from_counts_is_what_is_scored_with(raw):
    case = Case("raw", (), 0.0, "white", 5, raw)
    truth = draw(case).truth
    shot = motions(truth, case)[0]
    jitter = np.diff(shot.displacement_m[30:900], 4).std() / np.sqrt(70)
    assert jitter == pytest.approx(truth.noise.white_m, rel=0.12)
