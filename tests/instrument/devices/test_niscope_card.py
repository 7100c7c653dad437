"""The NI-SCOPE driver: NI's real package over a stub of its C library, and the message if the package is missing."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.shot.recording import Role
from instrument.devices.digitizer import CaptureSettings, DigitizerError
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


def test_a_record_all_pre_trigger_is_refused() -> None:
    class Package:
        Session = staticmethod(lambda resource: None)

    card = NiscopeCard("Dev1", {"0": Role.MEASUREMENT}, package=Package)
    with pytest.raises(DigitizerError, match="pre-trigger part must be shorter"):
        card.arm(CaptureSettings(1e7, 100, 100))
