"""Where the recordings of the rig lie, and skipping with a reason where they do not."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as analysis/__init__.py does; a test may import numpy before it

# pytest's own, 1e-12, lets pass whatever displacements in m or densities in m2/Hz are compared with
type(pytest.approx(0.0)).DEFAULT_ABSOLUTE_TOLERANCE = 1e-30

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return one worker more than cores: the tests wait for deadlines and processes for a sixth of their time."""
    return (os.cpu_count() or 1) + 1


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return the folder of independent raw recordings, or skip."""
    folder = SHARED / "recordings"
    if not folder.is_dir():
        pytest.skip("the recordings of ../shared are not on this machine")
    return folder


@pytest.fixture(scope="session")
def measured() -> Path:
    """Return the folder of measured motion records, or skip."""
    folder = SHARED / "measured"
    if not folder.is_dir():
        pytest.skip("the measured data of ../shared are not on this machine")
    return folder
