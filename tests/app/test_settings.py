"""The settings file: kept whole, checked, and never able to stop a start."""

import json

import pytest

from app.session import settings_file
from app.session.settings import FIELDS, Settings, WrongSettings


def test_what_is_saved_comes_back(tmp_path):
    path = tmp_path / "sub" / "settings.json"
    chosen = Settings(moving_mass_kg=0.02, temperature_c=21.0, pressure_pa=1e5, humidity_percent=40.0, folder="/x")
    assert settings_file.save(path, chosen) is None
    assert settings_file.load(path) == (chosen, [])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"levimass_settings": 99}',
        '{"levimass_settings": 1, "moving_mass_kg": "heavy"}',
        '{"levimass_settings": 1, "moving_mass_kg": -1}',
        '{"levimass_settings": 1, "moving_mass_kg": true}',
        '{"levimass_settings": 1, "edge": 3}',
        '{"levimass_settings": 1, "sample_rate_hz": null}',
        "\x00\xff",
        '{"levimass_settings": 1, "moving_mass_kg": Infinity}',
        '{"levimass_settings": 1, "moving_mass_kg": ' + "9" * 400 + "}",
        '{"levimass_settings": 1, "edge": "either", "edge": "either"}',
        '{"levimass_settings": 1, "edge": ' + "[" * 100_000,
    ],
)
def test_a_spoilt_file_gives_the_last_good_copy_and_says_so(tmp_path, text):
    path = tmp_path / "settings.json"
    settings_file.save(path, Settings(moving_mass_kg=0.03))
    settings_file.save(path, Settings(moving_mass_kg=0.04))
    path.write_text(text, encoding="latin-1")
    found, words = settings_file.load(path)
    assert found.moving_mass_kg == 0.03
    assert "last good copy" in words[0]
    assert (tmp_path / "settings.json.unreadable").exists()


def test_without_any_good_file_the_programs_own_are_used(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text("nonsense")
    found, words = settings_file.load(path)
    assert found == Settings()
    assert len(words) == 1


def test_a_newer_programs_extra_setting_is_left_out_and_said(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"levimass_settings": 1, "moving_mass_kg": 0.02, "flux": 3}))
    found, words = settings_file.load(path)
    assert found.moving_mass_kg == 0.02
    assert "flux" in words[0]


@pytest.mark.parametrize(
    "values",
    [
        {"temperature_c": 20.0},
        {"switch_low_v": 1.0},
        {"switch_low_v": 2.0, "switch_high_v": 1.0},
        {"pre_trigger_s": 1.0, "duration_s": 0.1},
        {"moving_mass_kg": float("nan")},
        {"model": "perpetual"},
        {"colour": "red"},
    ],
)
def test_what_does_not_go_together_is_refused_in_words(values):
    with pytest.raises(WrongSettings) as refused:
        Settings().with_values(values)
    assert len(str(refused.value)) > 10


def test_every_field_of_the_sheet_is_a_setting_within_its_limits():
    values = Settings().values()
    for field in FIELDS:
        assert field.key in values
        assert field.hover
