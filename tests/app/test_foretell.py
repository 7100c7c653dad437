"""``--foretell``: a saved model unchanged on records that took no part in it."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.prediction_errors import evaluate_predictions
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.diagnosis.findings.result import Errors, PredictionTest
from analysis.diagnosis.findings.wording import prediction_words
from analysis.drive.driven_fit import fit_driven
from analysis.shot.shot import AnalysisError
from app.command_line.cli import main
from app.session.load import load_and_analyse
from app.session.model_in_use import predictions_of
from instrument.files.motion_file import read_motion
from tests.analysis.drive.slider import Drive, Floats
from tests.analysis.shots import shots_of


def friction(x: Floats, v: Floats) -> Floats:
    return 20.0 * np.sign(v)


def record(folder: Path, name: str, drive: Drive) -> Path:
    motion = drive.motion()
    rows = np.stack([motion.time_s, motion.displacement_m, motion.force_n], axis=1)
    header = "time_s,displacement_m,force_n"
    np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.12g")
    (folder / f"{name}.toml").write_text('model = "driven"\n')
    return folder / f"{name}.csv"


def model_of(drive: Drive, effects: tuple[str, ...]) -> str:
    """Return the text of a model file learnt from one record, its base beside it."""
    motions = [drive.motion()]
    model = saved(fit_driven(motions, effects), ["learnt"])
    bare = saved(fit_driven(motions), ["learnt"])
    text = to_text(model)
    return text + to_text(bare).split("[parameters]")[1].split("[covariance]")[0].join(["\n[base_parameters]", ""])


def test_a_right_model_foretells_another_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(model_of(Drive(friction), ("coulomb_friction",)))
    other = record(tmp_path, "other", Drive(friction, seed=5, waves=((0.05, 0.4), (0.02, 1.1)), seconds=12.0))
    arguments = ["--replay", str(other), "--model", str(tmp_path / "model.toml"), "--foretell", "--no-diagnose"]
    outputs = [
        "--json",
        str(tmp_path / "out.json"),
        "--export",
        str(tmp_path / "csv"),
        "--report",
        str(tmp_path / "r.html"),
    ]
    assert main([*arguments, *outputs]) == 0
    assert "predicted better by" in capsys.readouterr().out
    told = json.loads((tmp_path / "out.json").read_text())["foretold"]
    assert told["error_model"]["force_rms_n"] < 0.5 < 5.0 < told["error_base"]["force_rms_n"]
    assert set(told["error_model"]) == {"displacement_rms_m", "velocity_rms_m_per_s", "force_rms_n", "reduced_chi2"}
    assert told["shots"][0]["took_part"] is False
    rows = list(csv.DictReader((tmp_path / "csv" / "foretold.csv").open()))
    assert [row["name"] for row in rows] == [str(other), "all"]
    assert float(rows[0]["model_force_rms_n"]) == told["shots"][0]["error_model"]["force_rms_n"]
    report = (tmp_path / "r.html").read_text()
    assert "Test of model predictions" in report
    assert ">nan" not in report
    assert " nan " not in report


def test_a_wrong_model_does_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(model_of(Drive(friction), ("coulomb_friction",)))
    other = record(
        tmp_path, "other", Drive(waves=((0.05, 0.4), (0.02, 1.1)), seconds=12.0)
    )  # another drive: no friction
    arguments = ["--replay", str(other), "--model", str(tmp_path / "model.toml"), "--foretell", "--no-diagnose"]
    assert main(arguments) == 0
    assert "predicted worse" in capsys.readouterr().out


def test_the_window_says_it_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(model_of(Drive(friction), ("coulomb_friction",)))
    other = record(tmp_path, "other", Drive(friction, seed=5, waves=((0.05, 0.4), (0.02, 1.1)), seconds=12.0))
    shot = load_and_analyse(other)
    said = predictions_of(tmp_path / "model.toml", [shot], lambda _what, _share: None, lambda: False)
    assert "predicted better by" in said
    with pytest.raises(AnalysisError, match="base model, driven"):
        predictions_of(tmp_path / "model.toml", [], lambda _what, _share: None, lambda: False)


def test_without_a_file_it_is_wrong_usage(tmp_path: Path) -> None:
    assert main(["--replay", str(tmp_path), "--foretell"]) == 2
    assert main(["--replay", str(tmp_path), "--foretell", "--model", "contact"]) == 2


@pytest.mark.slow
def test_the_air_track_foretells_a_run_it_never_saw(measured: Path) -> None:
    from analysis.signal.record import motion_from_displacement

    motions = []
    for number in range(1, 6):
        r = read_motion(measured / f"airtrack-{number}.csv")
        motions.append(motion_from_displacement(r.time_s, r.displacement_m, None, None, r.moving_mass_kg, 1e-4))
    found = diagnose(motions[:4], model="contact")
    model = from_text(to_text(saved(found.fit_after, [str(n) for n in range(1, 5)], found)))
    told = evaluate_predictions(shots_of(motions)[4:], model)
    # the camera alone leaves 40 um; each run's own flights are fitted beside the base as well
    assert told.error_model.displacement_rms_m < 62e-6 < 75e-6 < told.error_base.displacement_rms_m
    assert "predicted better by" in prediction_words(told)


@pytest.mark.parametrize(
    ("base", "model", "begins"),
    [
        (1e-6, 5e-7, "predicted better by 50%:"),
        (1e-6, 1e-6, "predicted worse by 0%:"),
        (1e-6, 1.001e-6, "predicted worse by 0%:"),
        (1e-6, 3e-6, "predicted worse by 200%:"),
        (0.0, 1e-6, "predicted worse:"),
        (0.0, 0.0, "predicted worse:"),
        (1e-6, float("inf"), "predicted worse:"),
    ],
)
def test_the_sentence_has_no_endless_share_and_no_minus_nothing(base: float, model: float, begins: str) -> None:
    told = PredictionTest("paper", (), Errors(base, 0.0, 0.0, 1.0), Errors(model, 0.0, 0.0, 1.0), ())
    assert prediction_words(told).startswith(begins)
