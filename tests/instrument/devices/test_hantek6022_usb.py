"""The Hantek 6022 driver on unmodified libusb and pyusb, over an emulated usbfs (umockdev)."""

import ctypes.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
HOUSE = HERE.parents[2]

pytestmark = pytest.mark.skipif(
    shutil.which("umockdev-wrapper") is None or ctypes.util.find_library("usb-1.0") is None,
    reason="needs umockdev and libusb (apt install umockdev libumockdev0 libusb-1.0-0)",
)

SETTLING = 8  # packets the driver drops after a start


@pytest.fixture
def play(tmp_path: Path):
    """Return a function that plays a scene of usb_trial in its own process."""

    def run(scene: str) -> dict:
        command = ["umockdev-wrapper", sys.executable, str(HERE / "usb_trial.py"), scene, str(tmp_path)]
        env = {**os.environ, "PYTHONPATH": str(HOUSE)}
        ran = subprocess.run(command, cwd=HOUSE, env=env, capture_output=True, text=True, timeout=60, check=False)
        assert ran.returncode == 0, ran.stderr
        return json.loads(ran.stdout)

    return run


def test_firmware_is_loaded_and_the_device_comes_back(play) -> None:
    result = play("firmware")
    assert result["found"][0][0] == "hantek6022"
    assert result["loaded"]
    assert result["told"] == [[0xE3, 0], [0xE0, 2], [0xE1, 2], [0xE2, 1], [0xE4, 2], [0xE3, 1], [0xE3, 0]]
    read = result["read"]
    assert (read["first"], read["breaks"], read["gaps"], read["fault"]) == (SETTLING, [], [], "")
    assert read["samples"] > 0.2e6


def test_thirty_megabytes_a_second_come_without_a_gap(play) -> None:
    result = play("streaming")
    read = result["read"]
    assert (read["first"], read["breaks"], read["fault"]) == (SETTLING, [], "")
    assert read["samples"] > 0.5 * 15e6 * read["seconds"]  # on a busy computer the emulator lags
    assert "in use by another program" in result["second"]
    assert result["claimed"] == 0


def test_a_stall_is_cleared_and_told_as_a_gap(play) -> None:
    result = play("stall")
    once = result["once"]
    assert once["fault"] == ""
    assert len(once["gaps"]) == 1
    assert once["gaps"][0] == (2 << 20) // 2 - SETTLING * 256
    assert once["samples"] > once["gaps"][0]
    assert "endpoint stalled" in result["always"]["fault"]
    assert result["always"]["samples"] >= (1 << 20) // 2 - SETTLING * 256  # what came before is kept
    after = result["after"]
    assert (after["first"], after["breaks"], after["gaps"], after["fault"]) == (SETTLING, [], [], "")
    assert after["samples"] > 0


def test_a_device_that_falls_silent_times_out_and_can_be_armed_again(play) -> None:
    result = play("silence")
    assert "sends nothing" in result["read"]["fault"]
    assert result["read"]["samples"] == (1 << 20) // 2 - SETTLING * 256
    assert result["read"]["seconds"] < 2.0
    assert result["after"]["samples"] > 0
    assert result["after"]["fault"] == ""


def test_a_silent_overrun_is_told_by_the_clock(play) -> None:
    read = play("overrun")["read"]
    assert [step for _, step in read["breaks"]] == [3001]
    assert read["gaps"][-1] > read["breaks"][0][0] * 256  # how soon is tested where time is not the computer's


def test_unplugged_in_mid_shot_what_came_is_kept_and_replugging_recovers(play) -> None:
    result = play("unplug")
    read = result["read"]
    assert "was unplugged: plug it in again" in read["fault"]
    assert (read["first"], read["breaks"], read["gaps"]) == (SETTLING, [], [])
    assert read["samples"] > 0.2 * 10e6 * 0.5
    assert "no Hantek 6022 is plugged in" in result["missing"]
    assert result["again"]["fault"] == ""
    assert result["again"]["samples"] > 0


def test_stop_is_heard_from_another_thread(play) -> None:
    assert play("stop")["slowest"] < 1.0


def test_in_a_process_of_its_own_it_is_unplugged_and_plugged_in_again(play) -> None:
    result = play("apart")
    read, again = result["read"], result["again"]
    assert (read["first"], read["breaks"]) == (SETTLING, [])
    assert "unplugged" in read["fault"] and read["samples"] > 0.1e6
    assert "no Hantek 6022 is plugged in" in result["missing"]
    assert (again["first"], again["breaks"], again["fault"]) == (SETTLING, [], "")
    assert again["samples"] > 0.1e6
    assert result["child"] is None


def test_a_request_that_is_never_answered_ends_with_the_deadline(play) -> None:
    """Opening and arming got a minute each whatever --timeout said; here it is 1 s, from where the request hangs."""
    for what, (status, seconds, said) in play("hang").items():
        assert seconds < 4.0, (what, seconds)
        assert said.count("\n") == 1 and "Traceback" not in said, said
        if what == "stopping":  # the shot is there
            assert status == 0 and "shot 1 of 1" in said
        else:
            assert status == 1 and "does not answer" in said, (what, said)
