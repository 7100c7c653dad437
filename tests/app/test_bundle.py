"""What who helps is sent: checks, versions, settings and log, without home folder and without recordings."""

import json
import os
import zipfile
from pathlib import Path

import pytest

from app.command_line import doctor
from app.command_line.cli import main
from app.command_line.doctor import write_bundle
from app.command_line.options import USAGE
from instrument.devices.doctor import Check, Grade


def test_a_bundle_holds_what_helps_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home" / "somebody"
    (home / "recordings").mkdir(parents=True)
    (home / "recordings" / "shot.sigmf-data").write_bytes(b"counts")
    (home / "levimass.log").write_text(f"could not read {home}/recordings/shot\n")
    (home / "levimass.log.1").write_text("older\n")
    (home / "settings.json").write_text("{}")
    monkeypatch.setattr(doctor, "user_log_path", lambda name: home)
    monkeypatch.setattr(doctor, "user_config_path", lambda name: home)
    monkeypatch.setattr(Path, "home", lambda: home)
    write_bundle(tmp_path / "help.zip", [Check("disk", Grade.WARN, f"little is free in {home}")])
    with zipfile.ZipFile(tmp_path / "help.zip") as written:
        texts = {name: written.read(name).decode() for name in written.namelist()}
    assert set(texts) == {"doctor.txt", "versions.txt", "settings.json", "levimass.log", "levimass.log.1"}
    assert texts["doctor.txt"] == "warn  disk: little is free in ~\n"
    assert "numba" in texts["versions.txt"]
    assert texts["levimass.log"] == "could not read ~/recordings/shot\n"
    assert not any("somebody" in text for text in texts.values())


def test_a_bundle_goes_with_the_doctor(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--bundle", "x.zip"]) == USAGE
    assert "--doctor" in capsys.readouterr().err


def test_a_bundle_that_cannot_be_written_is_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--doctor", "--bundle", str(tmp_path / "no" / "folder.zip")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("levimass: ") and error.count("\n") == 1


@pytest.mark.parametrize("name", ["andré", "jörg müller", "somebody"])
def test_no_spelling_of_the_user_s_name_goes_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    real = tmp_path / "disk" / name
    real.mkdir(parents=True)
    home = tmp_path / "home" / name
    home.parent.mkdir()
    home.symlink_to(real)
    settings = {"folder": f"{home}/shots", "recent": f"{real}/a\n/media/{name}/stick/b", "session": f"/run/{name}"}
    (home / "settings.json").write_text(json.dumps(settings, indent=1))
    (home / "levimass.log").write_text(f"could not read {real}/x\nnor /media/{name}/stick\nnor /media/{name}\n")
    os.mkfifo(home / "levimass.log.1")  # is not waited for
    monkeypatch.setattr(doctor, "user_log_path", lambda name: home)
    monkeypatch.setattr(doctor, "user_config_path", lambda name: home)
    monkeypatch.setattr(Path, "home", lambda: home)
    write_bundle(tmp_path / "help.zip", [Check("disk", Grade.WARN, f"little is free in {home}")])
    with zipfile.ZipFile(tmp_path / "help.zip") as written:
        texts = {each: written.read(each).decode() for each in written.namelist()}
    assert not any(name in text or json.dumps(name)[1:-1] in text for text in texts.values()), texts
    assert "levimass.log.1.missing" in texts and "stick/b" in texts["settings.json"]
