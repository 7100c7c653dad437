"""``levimass replay`` as a script uses it: good shots analysed, bad ones named in one line, never a traceback."""

import csv
import json
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from app.command_line import replay
from app.command_line.cli import main
from app.session import model_in_use
from instrument.files.recording_writer import write_recording
from tests.analysis.synthetic_collision import Synthetic, motion_of
from tests.beats import recording_of

# the figures for the recording "paper": value and how far the replay may lie from it
PAPER = {
    "velocity_in_m_per_s": (-0.265000, 3e-6),
    "velocity_out_m_per_s": (0.261702, 3e-6),
    "cor_quasi_static": (0.987556, 2e-5),
    "force_peak_n": (0.5119, 0.004),
    "force_fwhm_s": (19.1e-3, 0.2e-3),
    "contact_time_s": (28.71e-3, 0.1e-3),
    "stiffness_slope_n_per_m": (214.3, 1.5),
    "deflection_max_m": (2.3885e-3, 5e-6),
}
FITTED = {
    "plate_stiffness_n_per_m": (221.4, 0.002),
    "plate_mass_kg": (1.984e-4, 0.01),
    "contact_stiffness_n_per_m": (1e4, 0.02),
    "contact_damping_n_s_per_m": (0.4, 0.02),
}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the stem of a sound recording."""
    stem = tmp_path_factory.mktemp("good") / "shot-1"
    write_recording(recording_of(Synthetic()), stem)
    return stem


def _meta(stem: Path) -> Path:
    return stem.with_name(stem.name + ".sigmf-meta")


def _data(stem: Path) -> Path:
    return stem.with_name(stem.name + ".sigmf-data")


def _copy(good: Path, folder: Path) -> Path:
    stem = folder / "bad"
    _meta(stem).write_bytes(_meta(good).read_bytes())
    _data(stem).write_bytes(_data(good).read_bytes())
    return stem


def _replay(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any], str]:
    status = main([str(a) for a in ("--replay", *arguments, "--json", "-")])
    printed = capsys.readouterr()
    return status, json.loads(printed.out), printed.err


def test_data_that_were_altered_are_said_everywhere(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stem = _copy(good, tmp_path)
    data = bytearray(_data(stem).read_bytes())
    data[-2] ^= 1
    _data(stem).write_bytes(data)
    report = tmp_path / "report.html"
    status, result, _ = _replay(capsys, _meta(stem), "--no-diagnose", "--report", report, "--export", tmp_path / "out")
    assert status == 0 and "data_altered" in result["shots"][0]["flags"]
    assert "NOT the one written when the shot was taken" in report.read_text() and "data_altered" in report.read_text()
    assert "data_altered" in (tmp_path / "out" / "shots.csv").read_text()
    assert main(["--replay", str(_meta(stem)), "--no-diagnose"]) == 0
    assert "data_altered" in capsys.readouterr().out
    unchecked = ("--replay", str(_meta(stem)), "--no-diagnose", "--unchecked")
    assert main(unchecked) == 0 and "data_altered" not in capsys.readouterr().out


def test_a_sound_shot(good: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    status, result, complaints = _replay(capsys, _meta(good), "--export", tmp_path, "--no-diagnose")
    assert (status, complaints) == (0, "")
    (shot,) = result["shots"]
    assert result["schema"] == "levimass.result/1"
    assert result["diagnosis"] is None
    assert shot["status"] == "ok"
    for name, (value, within) in PAPER.items():
        assert shot[name]["value"] == pytest.approx(value, abs=within), name
        assert shot[name]["std"] > 0.0
    with open(tmp_path / "shots.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["cor_quasi_static"]) == shot["cor_quasi_static"]["value"]
    table = np.genfromtxt(tmp_path / row["motion_file"], delimiter=",", names=True)
    assert np.max(table["force_n"]) == pytest.approx(0.512, abs=0.01)
    assert np.sqrt(np.nanmean((table["displacement_m"] - table["model_displacement_m"]) ** 2)) < 1e-9


def _edited(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    def spoil(stem: Path) -> None:
        metadata = json.loads(_meta(stem).read_text())
        change(metadata)
        _meta(stem).write_text(json.dumps(metadata))

    return spoil


def _resampled(make: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    def spoil(stem: Path) -> None:
        counts = np.fromfile(_data(stem), "<i2").reshape(-1, 3)
        make(counts).astype("<i2").tofile(_data(stem))

    return spoil


def _noise(counts: np.ndarray) -> np.ndarray:
    return np.random.default_rng(0).normal(0.0, 50.0, counts.shape)


def _saturated(counts: np.ndarray) -> np.ndarray:
    return np.where(counts > 0, 2047, -2048)


def _flat(counts: np.ndarray) -> np.ndarray:
    return np.full_like(counts, 3)


BAD: dict[str, Callable[[Path], Any]] = {
    "no JSON": lambda stem: _meta(stem).write_text("not json {"),
    "not an object": lambda stem: _meta(stem).write_text("[1, 2]"),
    "wrong type": _edited(lambda m: m["global"].update({"core:sample_rate": "fast"})),
    "zero rate": _edited(lambda m: m["global"].update({"core:sample_rate": 0})),
    "huge rate": _edited(lambda m: m["global"].update({"core:sample_rate": 1e300})),
    "channels missing": _edited(lambda m: m["global"].pop("lmm:channels")),
    "no measurement": _edited(lambda m: m["global"]["lmm:channels"][1].update({"role": "switch"})),
    "mass missing": _edited(lambda m: m["global"]["lmm:setup"].pop("moving_mass_kg")),
    "negative mass": _edited(lambda m: m["global"]["lmm:setup"].update({"moving_mass_kg": -1})),
    "data missing": lambda stem: _data(stem).unlink(),
    "data empty": lambda stem: _data(stem).write_bytes(b""),
    "flat": _resampled(_flat),
    "noise only": _resampled(_noise),
    "saturated": _resampled(_saturated),
    "short": _resampled(lambda counts: counts[:500]),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_input_is_one_line(kind: str, good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stem = _copy(good, tmp_path)
    BAD[kind](stem)
    status, result, complaints = _replay(capsys, _meta(stem), _meta(good), "--no-diagnose")
    assert status == 1
    assert len(complaints.strip().splitlines()) == 1
    assert "bad" in complaints
    bad, sound = result["shots"]
    assert bad["status"] == "failed"
    assert bad["problem"]
    assert "\n" not in bad["problem"]
    assert sound["status"] == "ok"


def test_a_truncated_recording_is_analysed_and_flagged(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stem = _copy(good, tmp_path)
    _data(stem).write_bytes(_data(stem).read_bytes()[: 6 * 500_000 + 1])
    _, result, _ = _replay(capsys, _meta(stem), "--no-diagnose")
    (shot,) = result["shots"]
    assert shot["status"] == "ok"
    assert "truncated" in shot["flags"]
    assert shot["velocity_out_m_per_s"]["value"] == pytest.approx(0.261702, abs=3e-6)


def test_a_path_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, result, complaints = _replay(capsys, tmp_path / "nothing")
    assert status == 1
    assert len(complaints.strip().splitlines()) == 1
    assert result["shots"][0]["status"] == "failed"


def test_a_result_that_cannot_be_written(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["--replay", str(_meta(good)), "--no-diagnose", "--json", str(tmp_path / "no" / "such" / "out.json")])
    assert status == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_recording_paper(recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, result, _ = _replay(capsys, recordings / "paper", "--no-diagnose")
    assert status == 0
    (shot,) = result["shots"]
    for name, (value, within) in PAPER.items():
        assert shot[name]["value"] == pytest.approx(value, abs=within), name
    assert shot["cor_impulse"]["value"] == pytest.approx(shot["cor_quasi_static"]["value"], abs=5e-4)
    assert shot["cor_kinetic"]["force_peaks"]["value"] == pytest.approx(0.563, abs=0.012)
    for name, (value, share) in FITTED.items():
        fitted = shot["fit"]["parameters"][name]
        assert fitted["value"] == pytest.approx(value, rel=share), name
        assert abs(fitted["value"] - value) < 4.5 * fitted["std"], name


def test_a_motion_record_without_the_mass_s_uncertainty(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion = motion_of(Synthetic())
    np.savetxt(
        tmp_path / "shot.csv",
        np.column_stack([motion.time_s, motion.displacement_m]),
        delimiter=",",
        header="time_s,displacement_m",
        comments="",
    )
    (tmp_path / "shot.toml").write_text('model = "plate"\nmoving_mass_kg = 0.01785\n')
    status, result, complaints = _replay(capsys, tmp_path / "shot.csv", "--no-diagnose")
    assert (status, complaints) == (0, "")
    assert result["shots"][0]["cor_quasi_static"]["value"] == pytest.approx(0.987556, abs=2e-5)
    assert result["shots"][0]["rest_frequency_hz"] is None


def test_a_missing_path_is_told_once_and_on_standard_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--replay", str(tmp_path / "none.sigmf-meta"), "--no-diagnose"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("none.sigmf-meta") == 1


BAD_MODEL = """schema = "levimass.model/1"
base = "paper"
effects = []
[parameters]
plate_stiffness_n_per_m = {{ value = {stiffness}, std = 0.1 }}
plate_mass_kg = {{ value = 1.984e-4, std = 1e-8 }}
contact_stiffness_n_per_m = {{ value = 1e4, std = 1.0 }}
contact_damping_n_s_per_m = {{ value = 0.4, std = 1e-3 }}
"""


@pytest.mark.parametrize(
    "stiffness",
    # the last for two minutes, until its prediction is given up; quicker: one that does not end, below
    ["0.0", "-205.0", "1e300", "1e15", pytest.param("1e-15", marks=pytest.mark.slow)],
)
def test_a_model_that_no_plate_has_costs_no_output(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], stiffness: str
) -> None:
    (tmp_path / "m.toml").write_text(BAD_MODEL.format(stiffness=stiffness))
    command = ["--replay", str(_meta(good)), "--no-diagnose", "--model", str(tmp_path / "m.toml"), "--foretell"]
    status = main([*command, "--json", str(tmp_path / "out.json")])
    said = capsys.readouterr().err
    refused = "m.toml: parameters.plate_stiffness_n_per_m.value" in said
    assert refused is (stiffness in ("0.0", "-205.0", "1e300"))
    assert "Traceback" not in said and said.count("\n") <= 2 and (status in (0, 1))
    assert refused or json.loads((tmp_path / "out.json").read_text())["shots"][0]["status"] == "ok"


def test_a_prediction_that_does_not_end_is_given_up_and_costs_no_output(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = threading.Event()

    def endless(*_: object) -> None:  # its time is the processor's
        while not ended.is_set():
            pass

    monkeypatch.setattr("analysis.diagnosis.evaluate_predictions", endless)
    monkeypatch.setattr("app.session.model_in_use.FIT_SECONDS", 0.1)
    (tmp_path / "m.toml").write_text(BAD_MODEL.format(stiffness="221.4"))
    command = ["--replay", str(_meta(good)), "--no-diagnose", "--model", str(tmp_path / "m.toml"), "--foretell"]
    try:
        assert main([*command, "--json", str(tmp_path / "out.json")]) == 1
    finally:
        ended.set()
    said = capsys.readouterr().err
    assert said.startswith("levimass: no prediction: ") and said.count("\n") == 1
    written = json.loads((tmp_path / "out.json").read_text())
    assert written["foretold"] is None and written["shots"][0]["status"] == "ok"


def test_a_fault_in_one_output_costs_no_other(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fault(*_: object, **__: object) -> None:
        raise ZeroDivisionError("division by zero")

    for name in ("export", "predicted"):
        monkeypatch.setattr(f"app.command_line.replay.{name}", fault)
    (tmp_path / "m.toml").write_text(BAD_MODEL.format(stiffness="221.4"))
    wanted = ["--json", str(tmp_path / "o.json"), "--report", str(tmp_path / "o.html"), "--export", str(tmp_path / "x")]
    command = ["--replay", str(_meta(good)), "--no-diagnose", "--model", str(tmp_path / "m.toml"), "--foretell"]
    assert main([*command, *wanted]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 2 and "Traceback" not in said
    assert "no prediction: a fault of the program: ZeroDivisionError" in said and f"{tmp_path / 'x'}: a fault" in said
    assert json.loads((tmp_path / "o.json").read_text())["foretold"] is None and (tmp_path / "o.html").exists()


def test_names_as_long_as_they_may_be(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    long, wide = tmp_path / ("n" * 240), tmp_path / ("ä" * 115)
    for stem in (long, wide):
        _meta(stem).write_bytes(_meta(good).read_bytes())
        _data(stem).write_bytes(_data(good).read_bytes())
    out, report = tmp_path / ("j" * 225 + ".json"), tmp_path / ("r" * 250 + ".html")
    wanted = ["--json", str(out), "--report", str(report), "--export", str(tmp_path / "csv"), "--hdf5"]
    assert main(["--replay", str(_meta(long)), str(_meta(wide)), "--no-diagnose", *wanted]) == 0
    whole = json.loads(out.read_text())
    assert [shot["status"] for shot in whole["shots"]] == ["ok", "ok"] and report.stat().st_size > 1000
    rows = list(csv.DictReader((tmp_path / "csv" / "shots.csv").open()))
    assert all((tmp_path / "csv" / row["motion_file"]).exists() for row in rows)
    capsys.readouterr()
    too_long = str(tmp_path / ("j" * 256))
    assert main(["--replay", str(_meta(long)), "--no-diagnose", "--json", too_long]) == 1
    heard = capsys.readouterr()
    assert "File name too long" in heard.err and heard.err.count("\n") == 1 and heard.out == ""  # before the work


def test_a_diagnosis_that_fails_is_one_line_and_a_failure(
    good: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: Any, **__: Any) -> None:
        raise np.linalg.LinAlgError("Matrix is not positive definite")

    monkeypatch.setattr("app.command_line.replay.diagnose", failing)
    status, told, errors = _replay(capsys, good)
    assert status == 1
    assert told["diagnosis"] is None and told["shots"][0]["status"] == "ok"
    assert errors.splitlines() == [
        "levimass: no diagnosis: a fault of the program: LinAlgError: Matrix is not positive definite"
    ]


def test_a_diagnosis_has_the_seconds_it_is_given(
    good: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = []
    monkeypatch.setattr("app.command_line.replay._diagnosis", lambda *a: (given.append(a[2]), (None, False))[1])
    assert _replay(capsys, good, "--diagnosis-seconds", "7.5")[0] == 0
    assert _replay(capsys, good)[0] == 0
    assert given == [7.5, 60.0]


def test_a_number_that_lies_far_from_the_model_files_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    far = {"plate_mass_kg": -4.5, "plate_stiffness_n_per_m": 3.9, "contact_stiffness_n_per_m": 4.1}
    monkeypatch.setattr(model_in_use, "drift", lambda _known, _fit: far)
    replay._say_drift(cast(Any, None), cast(Any, SimpleNamespace(fit_after=None)))
    assert capsys.readouterr().err.splitlines() == [
        "levimass: plate_mass_kg deviates by -4.5 σ from the model file",
        "levimass: contact_stiffness_n_per_m deviates by +4.1 σ from the model file",
    ]
