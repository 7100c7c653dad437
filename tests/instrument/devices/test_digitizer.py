"""The contract: what a device need not write itself, faults in one line, and the settings of a shot left open."""

import pickle
from dataclasses import replace

import pytest

from analysis.shot.recording import Channel, Role, Setup
from instrument.devices.digitizer import (
    Block,
    Capabilities,
    CaptureSettings,
    Digitizer,
    DigitizerError,
    block_samples,
    usual_settings,
)
from instrument.devices.scpi_links import Stalled

ABLE = Capabilities("any", (Channel(Role.MEASUREMENT, 1e-3),), 12, (), None, False, False)


class Least(Digitizer):
    """What every device must write itself, and no more."""

    def __init__(self, able: Capabilities = ABLE) -> None:
        self.able, self.stopped = able, 0

    @property
    def capabilities(self) -> Capabilities:
        return self.able

    @property
    def setup(self) -> Setup:
        return Setup(0.01)

    def arm(self, settings: CaptureSettings) -> None: ...

    def read_into(self, buffer: object, timeout_s: float) -> Block:
        return Block(0)

    def stop(self) -> None:
        self.stopped += 1


class Preferring(Least):
    """A device that prefers settings of its own."""

    def default_settings(self) -> CaptureSettings:
        return CaptureSettings(5e6, 1000, 400)


def test_a_device_that_is_closed_is_stopped_and_one_without_a_preference_states_none() -> None:
    device = Least()
    device.prepare()
    assert device.default_settings() is None and device.stopped == 0
    device.close()
    assert device.stopped == 1
    assert (ABLE.unseen_loss_s, ABLE.simulated) == (0.0, False)  # unless it says so


@pytest.mark.parametrize(
    ("rates_hz", "most", "taken"),
    [
        ((30e6, 60e6, 15e6), None, CaptureSettings(30e6, 5_000_000, 312_500)),  # the paper's
        ((29e6, 31e6), None, CaptureSettings(29e6, 4_833_333, 302_083)),
        ((60e6, 40e6), None, CaptureSettings(40e6, 6_666_667, 416_666)),
        ((10e6,), 1_600, CaptureSettings(10e6, 1_600, 100)),
        ((6_000.0,), 2_000, CaptureSettings(6_000.0, 1_000, 62)),
    ],
)
def test_a_shot_left_open_is_a_sixth_of_a_second_at_the_fastest_rate_up_to_30_mhz(
    rates_hz: tuple[float, ...], most: int | None, taken: CaptureSettings
) -> None:
    assert usual_settings(Least(replace(ABLE, rates_hz=rates_hz, max_samples=most))) == taken


@pytest.mark.parametrize(
    ("most", "taken"),
    [
        (None, CaptureSettings(5e6, 1000, 400)),
        (2000, CaptureSettings(5e6, 1000, 400)),
        (700, CaptureSettings(5e6, 700, 400)),
        (300, CaptureSettings(5e6, 300, 300)),
    ],
)
def test_a_devices_own_settings_are_cut_to_its_memory(most: int | None, taken: CaptureSettings) -> None:
    assert usual_settings(Preferring(replace(ABLE, rates_hz=(30e6,), max_samples=most))) == taken


def test_without_a_rate_no_settings_are_made_up() -> None:
    with pytest.raises(DigitizerError, match=r"^any states no sample rate: give one$"):
        usual_settings(Least())


def test_a_block_is_40_ms_of_the_stream_between_256_samples_and_a_million() -> None:
    rates = (1.0, 6_400.0, 6_450.0, 10e6, 26e6, 27e6, 1e12)
    assert [block_samples(rate) for rate in rates] == [256, 256, 258, 400_000, 1_040_000, 1 << 20, 1 << 20]


def test_a_fault_is_one_line_with_its_remedy_and_the_same_in_another_process() -> None:
    for fault in (DigitizerError("gone", "plug it in"), Stalled("gone", "plug it in", b"half")):
        assert str(fault) == "gone: plug it in" and (fault.what, fault.remedy) == ("gone", "plug it in")
        there = pickle.loads(pickle.dumps(fault))
        assert type(there) is DigitizerError and str(there) == str(fault)
    assert str(DigitizerError("gone")) == "gone"
    long = DigitizerError("a\nb" * 200, "c\td" * 200)
    assert len(long.what) == len(long.remedy) == 400 and "\n" not in str(long) and "\t" not in str(long)


def test_a_block_is_the_same_in_another_process() -> None:
    for block in (Block(3), Block(1, None, True, 4, True), Block(0, 7, False, None, True), Block(9, 0, True, 0)):
        assert pickle.loads(pickle.dumps(block)) == block
    assert Block(3) == Block(3, lost_before=0, ended=False, trigger_sample=None, fired=False)
