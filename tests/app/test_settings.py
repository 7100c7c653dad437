"""The settings file: kept whole, checked, and never able to stop a start."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtWidgets import QPushButton, QWidget

from analysis.planning.next_shot import Reach
from analysis.shot.recording import SETUP_CORRECTED, Air, Setup, corrected_setup
from analysis.shot.shot import AnalysisSettings
from app.session import settings_store
from app.session.load import load_and_analyse
from app.session.session import Session
from app.session.settings import FIELDS, SITES, Settings, WrongSettings, correction_words
from app.session.settings_store import SettingsStore
from app.window.controls.file_dialog import PathKind
from app.window.panels import settings_sheet
from app.window.panels.settings_sheet import SettingsSheet
from instrument.devices.digitizer import CaptureSettings
from instrument.trigger.light_switch import Edge
from tests.instrument.fake_digitizer import FakeDigitizer


def test_what_is_saved_comes_back(tmp_path):
    path = tmp_path / "config" / "levimass" / "settings.json"
    chosen = Settings(moving_mass_kg=0.02, temperature_c=21.0, pressure_pa=1e5, humidity_percent=40.0, folder="/x")
    assert settings_store.save(path, chosen) is None
    assert settings_store.load(path) == (chosen, [])


@pytest.mark.skipif(os.name == "nt", reason="a file has no mode there")
def test_a_private_settings_file_stays_private_as_does_its_last_good_copy_and_has_a_setting_a_line(tmp_path):
    path = tmp_path / "settings.json"
    for mass_kg in (0.01, 0.02, 0.03):
        assert settings_store.save(path, Settings(moving_mass_kg=mass_kg)) is None
        if mass_kg == 0.01:
            path.chmod(0o600)
    found = {file.name: (file.stat().st_mode & 0o777, file.read_text().splitlines()) for file in tmp_path.iterdir()}
    assert found.keys() == {"settings.json", "settings.json.last-good"}  # nothing else is left behind
    for name, mass_kg in (("settings.json", 0.03), ("settings.json.last-good", 0.02)):
        mode, lines = found[name]
        assert mode == 0o600 and lines[:2] == ["{", ' "levimass_settings": 1,']
        assert f' "moving_mass_kg": {mass_kg},' in lines


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
    settings_store.save(path, Settings(moving_mass_kg=0.03))
    settings_store.save(path, Settings(moving_mass_kg=0.04))
    path.write_text(text, encoding="latin-1")
    found, words = settings_store.load(path)
    assert found.moving_mass_kg == 0.03
    assert "last good copy" in words[0]
    assert (tmp_path / "settings.json.unreadable").exists()


def test_without_any_good_file_the_programs_own_are_used(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text("nonsense")
    found, words = settings_store.load(path)
    assert found == Settings()
    assert len(words) == 1


def test_a_newer_programs_extra_setting_is_left_out_and_said(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"levimass_settings": 1, "moving_mass_kg": 0.02, "flux": 3}))
    found, words = settings_store.load(path)
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
        {"speeds_m_per_s": ""},
        {"speeds_m_per_s": "0.1 fast"},
        {"speeds_m_per_s": "0.1 -0.2"},
        {"speeds_m_per_s": "0.1 nan"},
        {"weights_kg": " ".join(["0.01"] * 13)},
        {"weights_kg": 0.05},
    ],
)
def test_what_does_not_go_together_is_refused_in_words(values):
    with pytest.raises(WrongSettings) as refused:
        replace(Settings(), **values)
    assert len(str(refused.value)) > 10


def test_speeds_and_weights_at_hand_are_what_a_plan_may_ask_for():
    assert Settings().reach == Reach()  # the plan's own, where nothing else was said
    reach = Settings(speeds_m_per_s="0.4 0.1", weights_kg="", run_up_m=0.02).reach
    assert reach == Reach((0.1, 0.4), (0.0,), 0.02)


def test_every_field_of_the_sheet_is_a_setting_within_its_limits():
    values = Settings().values()
    for field in FIELDS:
        assert field.key in values
        assert field.hover


def test_a_building_is_offered_with_the_velocity_of_its_criterion():
    """C. Gordon's curves: half as much from each to the next, 50 um/s down to 0.78."""
    offered = dict(SITES)
    assert offered["VC-A"] == "VC-A (50 µm/s)" and offered["VC-G"] == "VC-G (0.781 µm/s)"


def test_what_is_put_right_afterwards_reaches_a_shot_taken_before(tmp_path):
    store = SettingsStore(tmp_path / "settings.json")
    assert store.analysis_again() == store.analysis()  # nobody changed a thing: a recording keeps its own rig
    assert store.change({"moving_mass_kg": 0.018, "bandwidth_hz": 5e3}) is None
    again = store.analysis_again()
    assert again.corrections == (("moving_mass_kg", 0.018), ("moving_mass_u_kg", 1e-6)) and again.bandwidth_hz == 5e3
    assert store.analysis().corrections == ()
    assert correction_words(again.corrections) == ["moving mass 18 g"]

    air = {"temperature_c": 21.0, "pressure_pa": 1e5, "humidity_percent": 40.0}
    assert store.change(air) is None
    rig = corrected_setup(
        Setup(0.02, wavelength_air_m=632.8e-9, digitizer_bits=8), dict(store.analysis_again().corrections)
    )
    assert (rig.moving_mass_kg, rig.wavelength_air_m, rig.digitizer_bits) == (0.018, None, 8)
    assert rig.wavelength_vacuum_m == 632.991354e-9 and rig.air == Air(21.0, 1e5, 40.0)
    with pytest.raises(KeyError):
        corrected_setup(rig, {"plate": 1.0})


def test_a_corrected_mass_scales_the_force_of_a_motion_record_and_is_flagged(tmp_path):
    time_s = np.arange(400) * 1e-4
    rows = "".join(f"{t!r},{-0.2 * t!r}\n" for t in time_s.tolist())
    (tmp_path / "a.csv").write_text(f"time_s,displacement_m\n{rows}")
    (tmp_path / "a.toml").write_text('schema = "levimass.motion/1"\nmodel = "plate"\nmoving_mass_kg = 0.02\n')
    before = load_and_analyse(tmp_path / "a.csv")
    after = load_and_analyse(tmp_path / "a.csv", settings=AnalysisSettings(corrections=(("moving_mass_kg", 0.04),)))
    assert (before.motion.moving_mass_kg, after.motion.moving_mass_kg) == (0.02, 0.04)
    assert SETUP_CORRECTED in after.flags and SETUP_CORRECTED not in before.flags
    session = Session(tmp_path / "session.json")
    session.add(after)
    assert Session.reopen(tmp_path / "session.json").entries[0].settings == after.settings


def test_the_sheet_opens_in_its_first_field(qtbot):
    page = QWidget()
    qtbot.addWidget(page)
    sheet = SettingsSheet(page)
    page.show()
    sheet.open()
    assert sheet.isVisible() and page.focusWidget() is sheet._editors[FIELDS[0].key]
    empty = SettingsSheet(page)
    empty.open()  # nothing to be in
    assert empty.isVisible()


def test_a_folder_is_chosen_by_the_button_beside_its_field(qtbot, monkeypatch, tmp_path):
    sheet = SettingsSheet()
    qtbot.addWidget(sheet)
    sheet.show_values(Settings(folder="/before").values())
    asked = []

    def answered(parent, title, want, then, start):
        asked.append((want, start))
        then(tmp_path)

    monkeypatch.setattr(settings_sheet, "ask", answered)
    (browse,) = [button for button in sheet.findChildren(QPushButton) if button.text() == "…"]
    browse.click()
    assert asked == [(PathKind.FOLDER, "/before")]
    with qtbot.waitSignal(sheet.applied) as applied:
        sheet.apply()
    assert applied.args[0]["folder"] == str(tmp_path)


class _Digitizer(FakeDigitizer):
    def __init__(self, rates=(1e6, 5e6), most=None, own=None):
        super().__init__(max_samples=most)
        self._rates, self._own = rates, own

    @property
    def capabilities(self):
        return replace(super().capabilities, rates_hz=self._rates)

    def default_settings(self):
        return self._own


def test_a_shot_is_taken_with_the_nearest_rate_for_the_time_asked_within_what_the_device_can(tmp_path):
    settings = Settings(
        folder=str(tmp_path / "new" / "place"), sample_rate_hz=2.9e6, duration_s=0.2, pre_trigger_s=0.05,
        edge="falling", switch_low_v=0.1, switch_high_v=0.4, moving_mass_kg=0.02,
    )  # fmt: skip
    options = settings.options("hantek6022", _Digitizer())
    assert options.folder == tmp_path / "new" / "place" and options.folder.is_dir()
    assert options.settings == CaptureSettings(1e6, 200_000, 50_000)
    assert (options.edge, options.switch_low_v, options.switch_high_v) == (Edge.FALLING, 0.1, 0.4)
    assert options.setup == replace(settings.setup, digitizer_bits=12) and options.setup.moving_mass_kg == 0.02
    closer = replace(settings, sample_rate_hz=3.1e6).options("hantek6022", _Digitizer())
    assert closer.settings.sample_rate_hz == 5e6
    assert settings.options("scpi:x", _Digitizer(rates=())).settings == CaptureSettings(2.9e6, 580_000, 145_000)
    assert settings.options("scpi:x", _Digitizer(most=40_000)).settings == CaptureSettings(1e6, 40_000, 39_999)
    own = CaptureSettings(7e6, 70, 7)
    assert settings.options("scpi:x", _Digitizer(own=own)).settings == own
    assert settings.options("bench", _Digitizer()).setup is None  # it knows its rig
    assert replace(settings, edge="rising").options("bench", _Digitizer()).edge is Edge.RISING
    assert Settings(folder=str(tmp_path)).options("bench", _Digitizer()).edge is Edge.EITHER


def test_the_rig_has_the_air_that_was_given_and_none_otherwise():
    air = {"temperature_c": 21.0, "pressure_pa": 1e5, "humidity_percent": 30.0}
    assert Settings(**air, rest_frequency_hz=2e6).setup == Setup(
        17.85e-3, 1e-6, 632.991354e-9, None, Air(21.0, 1e5, 30.0), rest_frequency_hz=2e6
    )
    assert Settings().setup.air is None
    for name in air:
        with pytest.raises(WrongSettings, match="air: give"):
            Settings(**{key: value for key, value in air.items() if key != name})


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ({"pre_trigger_s": 0.1499}, {"pre_trigger_s": 0.15}),
        ({"switch_low_v": 0.4, "switch_high_v": 0.41}, {"switch_low_v": 0.4, "switch_high_v": 0.4}),
        ({"moving_mass_kg": 1e-4}, {"moving_mass_kg": 0.99e-4}),
        ({"duration_s": 100.0}, {"duration_s": 100.1}),
        ({"network": "x"}, {"network": 3}),
        ({"tour_done": True}, {"tour_done": "yes"}),
    ],
)
def test_settings_are_valid_up_to_their_limits(right, wrong):
    Settings(**right)
    with pytest.raises(WrongSettings):
        Settings(**wrong)


def test_corrections_are_said_in_the_units_of_the_sheet_without_the_mass_s_uncertainty():
    given = {"moving_mass_kg": 0.0179, "moving_mass_u_kg": 1e-6, "wavelength_air_m": None, "temperature_c": 21.5}
    assert correction_words(tuple(given.items())) == ["moving mass 17.9 g", "temperature 21.5 °C"]


def test_known_oscilloscopes_are_the_newest_five_that_have_an_address():
    addresses = [f"10.0.0.{n}" for n in range(8)]
    found = Settings(network=" ".join([*addresses[:2], "no:address:here", *addresses[2:]])).network_sources
    assert found == tuple(f"scpi:{address}" for address in (*addresses[:4],))
    assert Settings().network_sources == ()
