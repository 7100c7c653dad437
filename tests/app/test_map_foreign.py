"""Data from elsewhere, from ``--map`` to the same numbers; and a motion record as HDF5."""

import json
import shlex
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from analysis.shot.recording import Recording
from app.command_line.cli import main
from app.report.exports import MODEL_COLUMNS, MOTION_COLUMNS, export_hdf5
from app.session.load import load_and_analyse
from instrument.files.foreign_file import FOLDER_MAPPING
from instrument.files.recording_file import read_recording
from tests.app.synthetic import shot


@pytest.fixture
def taken(recordings: Path) -> Recording:
    return read_recording(recordings / "plain" / "shot-1")


def test_a_shot_saved_by_another_program_gives_the_same_numbers(taken: Recording, tmp_path: Path) -> None:
    path = tmp_path / "shot.wav"
    wavfile.write(path, int(taken.sample_rate_hz), np.asarray(taken.counts))
    roles = [str(channel.role) for channel in taken.channels]
    asked = [f"--channel={role}=channel {n}" for n, role in enumerate(roles, 1)]
    mass, wavelength = taken.setup.moving_mass_kg, taken.setup.wavelength_air_m
    bits = taken.setup.digitizer_bits
    asked += ["--mass", repr(mass), "--bits", str(bits), "--wavelength", repr(wavelength)]
    assert main(["--map", str(path), *asked]) == 0
    out, report = tmp_path / "result.json", tmp_path / "r.html"
    assert main(["--replay", str(tmp_path), "--no-diagnose", "--json", str(out), "--report", str(report)]) == 0
    (entry,) = json.loads(out.read_text())["shots"]
    own = load_and_analyse(Path(taken.path or ""))
    assert own.impact is not None
    for key in ("velocity_in_m_per_s", "velocity_out_m_per_s", "cor_quasi_static", "force_peak_n"):
        assert entry[key]["value"] == pytest.approx(getattr(own.impact, key).value, rel=1e-9), key
    page = report.read_text()
    assert "channel channel 2" in page and "shot.wav.levimass.toml" in page


def test_the_listing_shows_what_to_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "scope one.csv"
    table.write_text("PD0 (V),PD1 (V)\n" + "0.1,0.2\n0.3,0.1\n" * 50)
    assert main(["--map", str(table)]) == 0
    said = capsys.readouterr().out
    assert "'PD1': 100 samples" in said and "rate not stated" in said
    intro, example = next(pair for pair in pairwise(said.splitlines()) if "--channel measurement" in pair[1])
    assert "no mapping is saved" in intro and intro.endswith("for example")
    assert main(shlex.split(example.replace("HZ", "1e7"))[1:]) == 0
    table.with_name(f"{table.name}.levimass.toml").unlink()
    capsys.readouterr()
    asked = ["--map", str(table), "--channel", "measurement=PD1", "--mass", "0.02", "--rate", "1e6", "--rest", "2e5"]
    assert main([*asked, "--for-folder", "--volts", "measurement=-2"]) == 0
    assert (tmp_path / FOLDER_MAPPING).exists() and "100 samples at 1e+06" in capsys.readouterr().out
    assert main(["--map", str(table)]) == 0
    said = capsys.readouterr().out
    assert FOLDER_MAPPING in said and "measurement: 'PD1'" in said and "no mapping" not in said


@pytest.mark.parametrize(
    "options",
    [
        ["--channel", "measurement=PD1"], ["--channel", "reference=PD0", "--mass", "1"],
        ["--mass", "1"], ["--for-folder"],
        ["--channel", "light=PD1", "--mass", "1"], ["--channel", "measurement", "--mass", "1"],
        ["--channel", "measurement=PD1", "--mass", "1", "--volts", "measurement=much"],
        ["--channel", "measurement=PD1", "--mass", "1", "--volts", "switch=1"],
        ["--channel", "measurement=PD1", "--mass", "1", "--bits", "24"],
    ],
)  # fmt: skip
def test_options_that_say_nothing_are_one_line(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "t.csv"
    table.write_text("PD0,PD1\n1,2\n3,4\n")
    assert main(["--map", str(table), *options]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == [table]


def test_what_cannot_be_read_is_refused_and_not_remembered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "t.csv"
    table.write_text("PD0,PD1\n1,2\n3,4\n")
    for name in ("PD7", "PD1"):  # no such channel; no rate
        assert main(["--map", str(table), "--channel", f"measurement={name}", "--mass", "1"]) == 1
    assert main(["--map", str(tmp_path / "no.tdms")]) == 1
    assert main(["--replay", str(table), "--no-diagnose"]) == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 4 and "levimass map t.csv" in lines[3]
    assert list(tmp_path.iterdir()) == [table]
    assert main(["--mass", "1"]) == 2 and main(["--replay", "x", "--hdf5"]) == 2


def test_a_motion_in_hdf5_is_the_motion(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    one = replace(shot("a/b", count=4000), note="x\x00é", flags=("gap",))
    assert one.motion is not None and one.fit is not None
    (path,) = export_hdf5([one, shot("failed", problem="no impact")], tmp_path)
    with h5py.File(path) as file:
        group = file["motion"]
        for name in MOTION_COLUMNS:
            assert np.array_equal(group[name][:], getattr(one.motion, name), equal_nan=True), name
        assert set(MODEL_COLUMNS) <= set(group) and np.array_equal(group["valid"][:], one.motion.valid)
        assert group["velocity_m_per_s"].attrs["unit"] == "m/s" and group["time_s"].attrs["unit"] == "s"
        assert json.loads(file.attrs["settings"])["bandwidth_hz"] == 10e3
        result = json.loads(file.attrs["result"])
        assert result["cor_quasi_static"]["value"] == pytest.approx(0.987556)
    assert [p.name for p in tmp_path.iterdir()] == ["a_b.h5"]


def test_a_displacement_in_mm_gives_the_numbers_of_the_same_in_m(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time_s = np.arange(2000) / 20e3
    x_m = np.where(time_s < 0.04, 0.2 * (0.04 - time_s), 0.15 * (time_s - 0.04))
    table, own = tmp_path / "logger.csv", tmp_path / "own.csv"
    rows = [f"{1e3 * t:.6f};{1e3 * x:.9f}" for t, x in zip(time_s, x_m, strict=True)]
    table.write_text("time (ms);Weg (mm)\n" + "\n".join(rows).replace(".", ",") + "\n")
    rows = [f"{t:.9f},{x:.12f}" for t, x in zip(time_s, x_m, strict=True)]
    own.write_text("time_s,displacement_m\n" + "\n".join(rows) + "\n")
    own.with_suffix(".toml").write_text('model = "contact"\nmoving_mass_kg = 0.1\n')
    assert main(["--map", str(table)]) == 0
    assert "--channel displacement=Weg --mass" in capsys.readouterr().out
    asked = ["--map", str(table), "--channel", "displacement=Weg", "--mass", "0.1"]
    assert main([*asked, "--unit", "furlong"]) == 2
    assert main([*asked, "--volts", "measurement=1"]) == 2
    assert main([*asked, "--channel", "measurement=Weg"]) == 2
    assert main([*asked, "--model", "driven"]) == 2
    assert not table.with_suffix(".toml").exists()
    assert main(asked) == 0
    assert "displacement in mm over 0.0089925 m" in capsys.readouterr().out
    first, second = load_and_analyse(table), load_and_analyse(own)
    assert first.motion is not None and second.motion is not None
    np.testing.assert_allclose(first.motion.displacement_m, second.motion.displacement_m, atol=1e-12)
    assert main([*asked, "--unit", "um"]) == 0  # a person's unit goes before the header's
    third = load_and_analyse(table)
    assert third.motion is not None
    np.testing.assert_allclose(third.motion.displacement_m, 1e-3 * second.motion.displacement_m, atol=1e-12)
