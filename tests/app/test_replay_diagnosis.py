"""The joint diagnosis as a script sees it: the sets of the independent rig, whose truth is not told here either."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from app.command_line.cli import main
from instrument.bench.site import USUAL_SITE
from instrument.devices.sources import source_of


def _diagnosis(capsys: pytest.CaptureFixture[str], *paths: Path) -> dict[str, Any]:
    assert main(["--replay", *map(str, paths), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["schema"] == "levimass.result/1"
    diagnosis: dict[str, Any] = result["diagnosis"]
    for key in ("error_before", "error_after", "error_held_out_before", "error_held_out_after"):
        assert set(diagnosis[key]) == {"displacement_rms_m", "velocity_rms_m_per_s", "force_rms_n", "reduced_chi2"}
    return diagnosis


def test_the_plain_set_lacks_nothing(recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    diagnosis = _diagnosis(capsys, recordings / "plain")
    assert diagnosis["verdict"] == "adequate"
    assert diagnosis["effects"] == []
    assert diagnosis["error_after"] == diagnosis["error_before"]


@pytest.mark.parametrize(
    "number", [pytest.param(number, marks=pytest.mark.slow) for number in (1, 2, 4)]
)  # quicker: a model is saved and judges the next shots, below
def test_what_is_found_is_cured_on_the_shot_left_out(
    number: int, recordings: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No name is asserted: what was found must explain the shots that took no part, down to the noise."""
    diagnosis = _diagnosis(capsys, recordings / f"undeclared-{number}")
    assert diagnosis["verdict"] == "effect_found"
    before, after = diagnosis["error_held_out_before"], diagnosis["error_held_out_after"]
    assert after["displacement_rms_m"] < 0.25 * before["displacement_rms_m"]
    assert after["displacement_rms_m"] < 1e-9
    for effect in diagnosis["effects"]:
        for quantity in effect["parameters"].values():
            assert abs(quantity["value"]) > 5.0 * quantity["std"]


@pytest.mark.slow
def test_what_no_effect_explains_is_learned_as_a_law(recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    diagnosis = _diagnosis(capsys, recordings / "undeclared-3")
    assert diagnosis["verdict"] == "law_learned" and diagnosis["effects"] == []
    (law,) = diagnosis["laws"]
    assert (law["where"], law["argument"], law["formula"]) == ("block", "place", "a*exp(-abs(x)/b)")
    assert law["parameters"]["b"]["std"] < 1e-3 * law["parameters"]["b"]["value"]
    before, after = (diagnosis[f"error_held_out_{when}"]["displacement_rms_m"] for when in ("before", "after"))
    assert after < 1e-3 * before
    assert len(law["curve"]["argument"]) == len(law["curve"]["force_n"]) == len(law["curve"]["std_n"])


def test_a_model_is_saved_and_judges_the_next_shots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shots, model = tmp_path / "shots", tmp_path / "model.toml"
    effect = "viscous_drag:coefficient_n_s_per_m=1e-3"
    assert main(["--simulate", str(shots), "--shots", "2", "--seed", "3", "--effect", effect]) == 0
    capsys.readouterr()
    assert main(["--replay", str(shots), "--save-model", str(model), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    written = tomllib.loads(model.read_text(encoding="utf-8"))
    stiffness = "plate_stiffness_n_per_m"  # its noise is small beside what mass and clock are known to
    assert written["combined_std"][stiffness] > written["parameters"][stiffness]["std"]
    first = result["diagnosis"]
    assert [e["name"] for e in first["effects"]] == ["viscous_drag"]
    for shot in result["shots"]:  # what rests on a model was made again with the one that was found
        assert shot["readings_model"] == {
            "base": "paper", "effects": ["viscous_drag"], "readings": ["cor_kinetic.contact"],
        }  # fmt: skip
        assert shot["fit"]["effects"] == []
    assert main(["--replay", str(shots), "--model", str(model), "--json", "-"]) == 0
    printed = capsys.readouterr()
    again = json.loads(printed.out)
    assert again["diagnosis"]["verdict"] == "adequate"
    assert "viscous_drag.coefficient_n_s_per_m" in again["shots"][0]["fit"]["parameters"]
    assert printed.err == ""  # the same shots: nothing has drifted from the model file

    model.write_text("schema = 'something else'\n")
    assert main(["--replay", str(shots), "--model", str(model)]) == 1
    assert "schema" in capsys.readouterr().err
    assert main(["--replay", str(shots), "--model", str(tmp_path / "none.toml")]) == 1


@pytest.mark.slow
def test_the_flaw_of_the_bench_in_the_list_is_found_where_the_bench_stands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who tries the program chooses it, takes a few shots and is to see it found: at 2e-4 the building hid it."""
    (flawed,) = (text for text, shown in source_of("bench").listed.items() if "flaw" in shown)
    data = tmp_path / "data"
    order = ["--acquire", "3", "--source", flawed, "--site", USUAL_SITE, "--out", str(data)]
    assert main([*order, "--rate", "10e6", "--samples", "1500000", "--timeout", "60"]) == 0
    assert main(["--replay", str(data)]) == 0
    assert "diagnosis: effect_found: The model lacks quadratic drag: coefficient" in capsys.readouterr().out
