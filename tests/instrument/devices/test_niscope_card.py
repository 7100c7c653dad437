"""The NI-SCOPE driver: NI's real package over a stub of its C library, and the message if the package is missing."""

import importlib.util
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import NoReturn

import numpy as np
import pytest

from analysis.shot.recording import Role
from instrument.devices.digitizer import Block, CaptureSettings, DigitizerError
from instrument.devices.niscope_card import NiscopeCard
from instrument.devices.sources import open_source

HERE = Path(__file__).parent
HOUSE = HERE.parents[2]
needs_package = pytest.mark.skipif(
    importlib.util.find_spec("niscope") is None, reason="NI's package is not installed (pip install niscope)"
)


@pytest.fixture(scope="module")
def stub(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("the stub of NI's library needs gcc on Linux")
    folder = tmp_path_factory.mktemp("niscope")
    for name, source in (("niscope", HERE / "niscope_stub.c"), ("nitclk", Path(os.devnull))):
        library = f"lib{name}.so"
        command = [compiler, "-shared", "-fPIC", "-x", "c", str(source), f"-Wl,-soname,{library}", "-o", library]
        subprocess.run(command, cwd=folder, check=True)
    return folder


def _trial(stub: Path, name: str, **environment: str) -> tuple[dict, list[str]]:
    log = stub / f"{name}.log"
    env = {**os.environ, "LD_LIBRARY_PATH": str(stub), "NISCOPE_LOG": str(log), "PYTHONPATH": str(HOUSE), **environment}
    command = [sys.executable, str(HERE / "niscope_trial.py"), name]
    ran = subprocess.run(command, env=env, cwd=HOUSE, capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout), log.read_text().splitlines() if log.exists() else []


@needs_package
def test_a_record_through_nis_own_package(stub: Path) -> None:
    result, told = _trial(stub, "shot")
    assert (result["samples"], result["trigger"], result["same"]) == (500_000, 50_000, True)
    assert result["scales"] == [["reference", 1e-4, 0.0], ["measurement", 1e-4, 1.5]]
    assert result["refused"] == "Dev1 samples at 6e+07/s, not at 9e+07: ask for 6e+07"
    assert told[:4] == [
        "vertical 0,3 2 V, coupling 1, on 1",
        "timing 3e+07 Hz, 500000 points, reference 10",
        "edge 2 1.5 V, slope 0, coupling 1",
        "abort",
    ]
    assert told[-1] == "close"


@needs_package
def test_waiting_for_the_trigger_is_stopped_from_another_thread(stub: Path) -> None:
    result, told = _trial(stub, "cancelled", NISCOPE_NEVER="1")
    assert (result["first"], result["ended"]) == (0, True)
    assert result["seconds"] < 2.0
    assert told[2:] == ["digital PFI_1 slope 1, 0 0", "abort", "close"]


@needs_package
def test_an_unknown_card_is_one_line_in_nis_words(stub: Path) -> None:
    result, _ = _trial(stub, "absent")
    assert "Device identifier is invalid." in result["line"]
    assert "\n" not in result["line"]


@needs_package
def test_an_absent_runtime_is_one_line_with_the_remedy() -> None:
    import ctypes.util

    if ctypes.util.find_library("niscope"):
        pytest.skip("the NI-SCOPE runtime is on this computer")
    with pytest.raises(DigitizerError, match=r"^the NI-SCOPE runtime is not installed: install .* ni\.com/downloads"):
        open_source("niscope:Dev1")


def test_an_absent_package_is_one_line_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "niscope", None)
    with pytest.raises(
        DigitizerError, match=r"niscope package, which is not installed: pip install 'levimass\[niscope"
    ):
        open_source("niscope:Dev1")


def test_the_card_offers_each_rate_once_that_its_clock_divides_to() -> None:
    """A card divides its clock by whole numbers and rounds any other rate, which `arm` then refuses."""

    class Package:
        Session = staticmethod(lambda resource: None)

    card = NiscopeCard("Dev1", {"0": Role.MEASUREMENT}, package=Package)
    rates = card.capabilities.rates_hz
    assert len(set(rates)) == len(rates)
    assert all(max(rates) / rate == round(max(rates) / rate) for rate in rates)
    settings = card.default_settings()
    assert settings is not None and rates[0] == settings.sample_rate_hz  # the list begins with the usual one


class Card:
    """NI's package and its one session, as the driver uses them; every call is noted."""

    VerticalCoupling = TriggerCoupling = SimpleNamespace(DC="dc")
    TriggerSlope = SimpleNamespace(POSITIVE="up", NEGATIVE="down")
    AcquisitionStatus = SimpleNamespace(COMPLETE=1)

    def __init__(self, rate: float = 30e6, polls: int = 2, **info: float) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.horz_sample_rate, self.polls, self.closed = rate, polls, 0
        self.info = {"gain": 1e-4, "offset": 0.5, "x_increment": 1 / 30e6, "relative_initial_x": -250.4 / 30e6} | info

    def Session(self, resource: str) -> "Card":
        self.calls.append(("open", resource))
        return self

    @property
    def channels(self) -> "Card":
        return self

    def __getitem__(self, names: str) -> "Card":
        self.names = names
        return self

    def configure_vertical(self, *given: object) -> None:
        self.calls.append(("vertical", self.names, *given))

    def configure_horizontal_timing(self, **given: object) -> None:
        self.calls.append(("timing", *given.items()))

    def configure_trigger_edge(self, *given: object) -> None:
        self.calls.append(("edge", *given))

    def configure_trigger_digital(self, *given: object) -> None:
        self.calls.append(("digital", *given))

    @contextmanager
    def initiate(self) -> Iterator[None]:
        self.calls.append(("initiate",))
        yield
        self.calls.append(("abort",))

    def acquisition_status(self) -> int:
        self.polls -= 1
        return int(self.polls < 0)

    def fetch_into(self, out: np.ndarray, timeout: float) -> list[SimpleNamespace]:
        self.calls.append(("fetch", self.names, timeout))
        out[:] = np.arange(out.size) % 30_000
        infos = [SimpleNamespace(**self.info) for _ in self.names.split(",")]
        for n, info in enumerate(infos):  # the times of a record are read from its first channel
            info.offset, info.x_increment = info.offset + n, info.x_increment * (1 + n)
        return infos

    def close(self) -> None:
        self.closed += 1
        raise RuntimeError("already gone")  # an error at closing loses nothing


def _opened(monkeypatch: pytest.MonkeyPatch, card: Card, text: str) -> NiscopeCard:
    monkeypatch.setitem(sys.modules, "niscope", card)
    opened = open_source(text)
    assert isinstance(opened, NiscopeCard)
    return opened


@pytest.mark.parametrize(
    ("text", "trigger"),
    [
        ("niscope:Dev2?channels=3,0,1", ("edge", "2", 1.0, "dc", "up")),
        ("niscope:Dev2?channels=3,0,1&trigger=7&level=-.5&slope=falling", ("edge", "7", -0.5, "dc", "down")),
        ("niscope:Dev2?channels=3,0,1&trigger=VAL_EXTERNAL", ("edge", "VAL_EXTERNAL", 1.0, "dc", "up")),
        ("niscope:Dev2?channels=3,0,1&trigger=PFI_1&slope=falling", ("digital", "PFI_1", "down")),
    ],
)
def test_a_card_is_set_and_its_record_fetched_as_asked_for(
    text: str, trigger: tuple[object, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = Card()
    card = _opened(monkeypatch, fake, f"{text}&range=4")
    roles = [Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH]
    able = card.capabilities
    assert [(c.role, c.volts_per_count, c.offset_v) for c in able.channels] == [(r, 4 / 65536, 0.0) for r in roles]
    assert (able.name, able.bits, able.max_samples, able.hardware_trigger, able.real_time) == (
        *("NI-SCOPE Dev2", 16, 2**28, True, False),
    )
    assert card.read_into(np.empty((9, 3), np.int16), 0.0) == Block(0, ended=True)  # not armed
    card.arm(CaptureSettings(30e6, 1000, 250))
    shot, at, trigger_at = np.empty((1000, 3), np.int16), 0, None
    while at < 1000:
        buffer = np.empty((301, 3), np.int16)
        block = card.read_into(buffer, 5.0)
        shot[at : at + block.samples] = buffer[: block.samples]
        if block.trigger_sample is not None:
            assert trigger_at is None
            trigger_at = at + block.trigger_sample
        at += block.samples
        assert block.samples > 0 and block.ended == (at == 1000) and block.lost_before == 0
    assert np.array_equal(shot.T, np.arange(3000).reshape(3, 1000)) and trigger_at == 250
    assert card.read_into(buffer, 0.0) == Block(0, ended=True)
    assert [(c.volts_per_count, c.offset_v) for c in card.capabilities.channels] == [(1e-4, 0.5 + n) for n in range(3)]
    assert fake.calls == [
        ("open", "Dev2"),
        ("vertical", "3,0,1", 4.0, "dc"),
        ("timing", ("min_sample_rate", 30e6), ("min_num_pts", 1000), ("ref_position", 25.0), ("num_records", 1),
         ("enforce_realtime", True)),
        trigger,
        ("initiate",),
        ("fetch", "3,0,1", 5.0),
        ("abort",),
    ]  # fmt: skip
    card.close()
    card.close()
    assert fake.closed == 1
    card.arm(CaptureSettings(30e6, 4_000_000, 0))  # opened anew; 2 us a sample to fetch it
    assert card.read_into(np.empty((4_000_000, 3), np.int16), 5.0).samples == 4_000_000
    assert fake.calls[7] == ("open", "Dev2") and ("fetch", "3,0,1", 8.0) in fake.calls


@pytest.mark.parametrize(
    ("info", "fault"),
    [
        ({"x_increment": 0.0}, "Dev1 reports a sample every 0 s: re-arm"),
        ({"x_increment": math.nan}, "Dev1 reports a sample every nan s"),
        ({"gain": math.inf}, "Dev1 reports no scale for its counts: re-arm"),
        ({"offset": math.nan}, "Dev1 reports no scale"),
        ({"relative_initial_x": math.nan}, "Dev1 reports no scale"),
    ],
)
def test_a_record_whose_scales_cannot_be_is_refused(info: dict[str, float], fault: str) -> None:
    card = NiscopeCard("Dev1", package=Card(**info))
    card.arm(CaptureSettings(30e6, 100, 10))
    with pytest.raises(DigitizerError, match=fault):
        card.read_into(np.empty((100, 2), np.int16), 5.0)
    assert card.read_into(np.empty((100, 2), np.int16), 0.0) == Block(0, ended=True)


@pytest.mark.parametrize(("off", "taken"), [(0.9e-6, True), (1.1e-6, False), (-1.1e-6, False)])
def test_a_rate_that_the_card_rounds_is_refused_with_the_one_it_takes(off: float, taken: bool) -> None:
    card = NiscopeCard("Dev1", package=Card(rate=30e6 * (1 + off)))
    if taken:
        card.arm(CaptureSettings(30e6, 100, 99))
        card.close()
    else:
        with pytest.raises(DigitizerError, match=r"samples at 3e\+07/s, not at 3e\+07: ask for 3e\+07"):
            card.arm(CaptureSettings(30e6, 100, 99))


@pytest.mark.parametrize("roles", [{"0": Role.REFERENCE}, {"0": Role.MEASUREMENT, "1": Role.MEASUREMENT}])
def test_one_channel_and_only_one_carries_the_moving_beat(roles: dict[str, Role]) -> None:
    with pytest.raises(DigitizerError, match="one channel of the card, and only one"):
        NiscopeCard("Dev1", roles, package=Card())


def test_a_wait_for_the_trigger_returns_in_time_and_ends_with_a_stop() -> None:
    card = NiscopeCard("Dev1", package=Card(polls=10**9))
    card.arm(CaptureSettings(30e6, 100, 10))
    assert card._worker is not None and card._worker.daemon
    scales = [(channel.volts_per_count, channel.offset_v) for channel in card.capabilities.channels]
    assert scales == [(2 / 65536, 0.0)] * 2  # of the usual range
    assert ("edge", "2", 1.0, "dc", "up") in card._niscope.calls  # and the usual trigger
    assert card.read_into(np.empty((100, 2), np.int16), 0.01) == Block(0)
    card.stop()
    assert card._worker is None
    assert card.read_into(np.empty((100, 2), np.int16), 5.0) == Block(0, ended=True)


@pytest.mark.parametrize(
    ("kind", "text", "line"),
    [
        ("DriverNotInstalledError", "no", r"the NI-SCOPE runtime is not installed: install .* ni\.com/downloads"),
        ("DriverTooOldError", "old", "the NI-SCOPE runtime is not installed: install"),
        (
            "DriverError",
            "the device\n is  busy",
            "Dev7: the device is busy: check the name in NI MAX, or levimass doctor",
        ),
        ("DriverError", "", "Dev7: DriverError: check the name in NI MAX"),
    ],
)
@pytest.mark.parametrize("at", ["Session", "configure_vertical", "acquisition_status", "fetch_into"])
def test_an_error_of_nis_package_is_one_line_wherever_it_comes(kind: str, text: str, line: str, at: str) -> None:
    def fails(*given: object, **named: object) -> NoReturn:
        raise type(kind, (Exception,), {})(text)

    package = Card(polls=0)
    if at == "Session":
        package.Session = fails  # type: ignore[method-assign]
        with pytest.raises(DigitizerError, match=f"^{line}"):
            NiscopeCard("Dev7", package=package)
        return
    card = NiscopeCard("Dev7", package=package)
    setattr(package, at, fails)
    with pytest.raises(DigitizerError, match=f"^{line}"):
        card.arm(CaptureSettings(30e6, 100, 10))
        card.read_into(np.empty((100, 2), np.int16), 5.0)
    assert card.read_into(np.empty((100, 2), np.int16), 0.0) == Block(0, ended=True)


def test_a_driver_that_hangs_is_waited_for_ten_seconds_and_left_behind() -> None:
    card, waited = NiscopeCard("Dev1", package=Card()), []  # type: ignore[var-annotated]
    card._worker = SimpleNamespace(join=lambda timeout: waited.append(timeout))  # type: ignore[assignment]
    card.stop()
    card.stop()
    assert waited == [10.0]


def test_arming_again_gives_up_the_record_before() -> None:
    card = NiscopeCard("Dev1", package=Card(polls=10**9))
    for _ in range(2):
        before = card._worker
        card.arm(CaptureSettings(30e6, 100, 10))
        assert before is None or not before.is_alive()
    last = card._worker
    card.close()
    assert last is not None and last is not before and not last.is_alive()


def test_a_record_all_pre_trigger_is_refused() -> None:
    class Package:
        Session = staticmethod(lambda resource: None)

    card = NiscopeCard("Dev1", {"0": Role.MEASUREMENT}, package=Package)
    with pytest.raises(DigitizerError, match="pre-trigger part must be shorter"):
        card.arm(CaptureSettings(1e7, 100, 100))
