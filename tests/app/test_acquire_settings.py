"""What ``levimass acquire`` asks of a digitizer, and the numbers its options accept."""

import argparse
from types import SimpleNamespace

import pytest

from app.command_line import acquire as module
from app.command_line.acquire import CaptureRequest, capture_settings
from app.command_line.options import _numbers, _positive, _positive_int, _speeds, _whole
from instrument.capture import AcquireError
from instrument.devices.digitizer import CaptureSettings, DigitizerError


def _with(*rates: float) -> SimpleNamespace:
    return SimpleNamespace(capabilities=SimpleNamespace(rates_hz=rates))


@pytest.mark.parametrize(
    ("rates", "rate", "samples", "asked"),
    [
        ((1e6, 2e6), None, None, (1e6, 60_000, 9_000)),
        ((1e6, 2e6), 2e6, None, (2e6, 120_000, 18_000)),
        ((1e6, 2e6), None, 1_000, (1e6, 1_000, 150)),
        ((1e6,), None, None, None),  # it has its own
        ((), None, None, None),
        ((1e6,), None, 10, (1e6, 10, 2)),
        ((), None, 100, (10e6, 100, 15)),
        ((), 5e6, None, (5e6, 300_000, 45_000)),
    ],
)
def test_a_shot_is_60_ms_long_with_15_per_cent_before_the_switch(rates, rate, samples, asked) -> None:
    expected = None if asked is None else CaptureSettings(*asked)
    assert capture_settings(_with(*rates), rate, samples) == expected  # type: ignore[arg-type]


def test_shots_are_recorded_as_requested_and_a_slow_device_has_time_to_arm(monkeypatch, tmp_path, capsys) -> None:
    asked: list[object] = []
    monkeypatch.setattr(module, "open_in_subprocess", lambda source, arm_s: asked.append((source, arm_s)) or _with(1e6))

    def record(digitizer, out, count, settings, timeout_s, report):
        asked.append((out, count, settings, timeout_s))
        report("armed")
        if count == 3:
            raise AcquireError("no third shot", [tmp_path / "a", tmp_path / "b"])
        return [tmp_path / f"{n}" for n in range(count)]

    monkeypatch.setattr(module, "record", record)
    request = CaptureRequest("scpi:host", tmp_path, 2e6, 500, 7.0)
    assert module.acquire(2, request) == 0
    assert asked == [("scpi:host", 10.0), (tmp_path, 2, CaptureSettings(2e6, 500, 75), 7.0)]
    told = capsys.readouterr()
    assert told.out.split() == [str(tmp_path / "0"), str(tmp_path / "1")] and "armed" in told.err
    assert module.acquire(3, CaptureRequest("scpi:host", tmp_path, None, None, 90.0)) == 1
    told = capsys.readouterr()
    assert told.out.split() == [str(tmp_path / "a"), str(tmp_path / "b")] and "no third shot" in told.err
    assert asked[2:] == [("scpi:host", 90.0), (tmp_path, 3, None, 90.0)]

    def refused(source, arm_s):
        raise DigitizerError("nothing there", "plug it in")

    monkeypatch.setattr(module, "open_in_subprocess", refused)
    assert module.acquire(1, request) == 1 and "nothing there" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("parse", "text", "value"),
    [
        (_whole, "0", 0),
        (_whole, "-1", None),
        (_positive_int, "1", 1),
        (_positive_int, "0", None),
        (_positive, "1e-300", 1e-300),
        (_positive, "0", None),
        (_positive, "inf", None),
        (_positive, "nan", None),
        (_numbers, "0.2,0.05,0.2", (0.05, 0.2)),
        (_numbers, "0", (0.0,)),
        (_numbers, "-0.1,0.2", None),
        (_numbers, "0.1,inf", None),
        (_numbers, "", None),
        (_speeds, "0.3,0.1", (0.1, 0.3)),
        (_speeds, "0,0.1", None),
    ],
)
def test_an_option_s_number_is_checked_at_its_limit(parse, text, value) -> None:
    if value is None:
        with pytest.raises(argparse.ArgumentTypeError):
            parse(text)
    else:
        assert parse(text) == value
