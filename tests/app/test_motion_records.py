"""Motion records as a new user brings them: the page's examples run, and what is wrong is said in words that help."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.shot import AnalysisError, AnalysisSettings
from app.command_line.cli import main
from app.session.load import analysed
from tests.analysis.camera import Camera
from tests.analysis.drive.slider import Drive
from tests.bench.blind import drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
EXAMPLES = re.findall(r"```toml\n(model = .*?)```\n\n```text\n(.*?)\n```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
Columns = dict[str, np.ndarray]


def seen(model: str) -> Columns:
    """Return what an instrument might have recorded of each base model."""
    if model == "driven":
        motion = Drive(seconds=8.0).motion()
        return {"time_s": motion.time_s, "displacement_m": motion.displacement_m, "force_n": motion.force_n}
    if model == "contact":
        motion = Camera().motion(30e-6)
        return {"time_s": motion.time_s, "displacement_m": motion.displacement_m}
    (record, *_) = records(drawn((), 11, Noise(NoiseKind.FLOOR)))
    return {"time_s": record.time_s, "displacement_m": record.displacement_m}


def written(folder: Path, about: str, columns: Columns, ending: str = ".csv") -> Path:
    parted = "\t" if ending == ".tsv" else ","
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(folder / f"r{ending}", rows, delimiter=parted, header=parted.join(columns), comments="", fmt="%.12g")
    (folder / "r.toml").write_text(about)
    return folder / f"r{ending}"


def said(path: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str, str]:
    status = main(["--replay", str(path), "--no-diagnose", *more])
    out = capsys.readouterr()
    return status, out.out, out.err


@pytest.mark.parametrize(("about", "header"), EXAMPLES)
def test_the_examples_of_the_page(about: str, header: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = seen(about.split('"')[1])
    status, out, err = said(written(tmp_path, about, {name: columns[name] for name in header.split(",")}), capsys)
    assert (status, err) == (0, "")
    assert "fit of model" in out


def test_the_page_has_an_example_of_every_base_model() -> None:
    assert [about.split('"')[1] for about, _ in EXAMPLES] == ["plate", "contact", "driven"]


def test_tabs_part_a_tsv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = said(written(tmp_path, 'model = "driven"', seen("driven"), ".tsv"), capsys)
    assert (status, err) == (0, "")
    assert "moving_mass_kg" in out


def test_a_missing_mass_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = said(written(tmp_path, 'model = "contact"', seen("contact")), capsys)
    assert status == 1
    assert "moving_mass_kg" in err
    assert "no impact" not in err


def test_a_wrong_sign_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = seen("contact")
    columns["displacement_m"] = -columns["displacement_m"]
    status, _, err = said(written(tmp_path, 'model = "contact"\nmoving_mass_kg = 0.0912', columns), capsys)
    assert status == 1
    assert "reverse its sign" in err


def test_a_shot_that_could_not_be_fitted_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is read and written out like any other, but it was not fitted: the status and a line say so."""

    def refuse(*_: object) -> None:
        raise AnalysisError("no motion of the contact model comes near these shots")

    path = written(tmp_path, 'model = "contact"\nmoving_mass_kg = 0.0912', seen("contact"))
    monkeypatch.setattr("analysis.fitted.fitted_shot.fit_jointly", refuse)
    status, out, err = said(path, capsys, "--json", str(tmp_path / "out.json"))
    assert status == 1
    assert "r.csv" in err and "not fitted: no motion of the contact model comes near these shots" in err
    assert "fit_failed" in out
    (shot,) = json.loads((tmp_path / "out.json").read_text())["shots"]
    assert shot["fit"] is None
    assert shot["velocity_in_m_per_s"]["value"] < 0.0
    assert "fit_failed" in shot["flags"]


def test_no_force_column_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = {name: column for name, column in seen("driven").items() if name != "force_n"}
    status, _, err = said(written(tmp_path, 'model = "driven"\nmoving_mass_kg = 95.0', columns), capsys)
    assert status == 1
    assert "force_n: no such column" in err


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ("time_s,displacement_m\n0,1\n1,x\n2,3\n", "row 3"),
        ("time_s,displacement_m\n0,1\n\n1,inf\n2,3\n", "row"),
        ("time_s,displacement_m\n0,1\n1\n2,3\n", "row 3"),
    ],
)
def test_bad_cells_are_counted_from_the_header(
    table: str, match: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "r.csv").write_text(table)
    (tmp_path / "r.toml").write_text('model = "contact"')
    status, _, err = said(tmp_path / "r.csv", capsys)
    assert status == 1
    assert match in err
    assert "displacement_m" in err


def test_the_report_of_a_drive_has_nothing_of_a_collision(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, 'model = "driven"', seen("driven"))
    assert main(["--replay", str(path), "--report", str(tmp_path / "r.html")]) == 0
    report = (tmp_path / "r.html").read_text(encoding="utf-8")
    for word in (">nan", " nan ", "0 shots", "COR", "first touch", "Residual of displacement"):
        assert word not in report, word


def test_a_unit_keeps_off_its_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = said(written(tmp_path, 'model = "driven"', seen("driven")), capsys)
    assert re.search(r"viscous_coefficient_n_s_per_m +\d", out)


def test_map_leads_positions_to_motion_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "camera.csv").write_text("t,x\n0,1\n0.1,2\n0.2,3\n")
    assert main(["--map", str(tmp_path / "camera.csv")]) == 0
    out = capsys.readouterr().out
    assert "motion record" in out
    assert "camera.toml" in out


def test_an_old_matlab_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("h5py")
    (tmp_path / "old.mat").write_bytes(b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(200))
    assert main(["--map", str(tmp_path / "old.mat")]) == 1
    assert "MATLAB file of version 5" in capsys.readouterr().err


@pytest.mark.parametrize(("said_of_it", "mass_u_kg"), [("", 0.0), ("moving_mass_u_kg = 1e-4\n", 1e-4)])
def test_a_mass_is_as_uncertain_as_the_record_says(said_of_it: str, mass_u_kg: float, tmp_path: Path) -> None:
    path = written(tmp_path, f'model = "contact"\nmoving_mass_kg = 0.0912\n{said_of_it}', seen("contact"))
    motion = analysed(path, settings=AnalysisSettings(fit=False)).motion
    assert motion is not None and motion.moving_mass_u_kg == mass_u_kg
