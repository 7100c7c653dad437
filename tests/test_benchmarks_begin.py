"""Every benchmark can be begun: what it asks of the program is still there, though no test runs it."""

import importlib
from pathlib import Path

import pytest

MODULES = sorted(path.stem for path in (Path(__file__).parent / "benchmarks").glob("*.py") if path.stem != "__main__")


@pytest.mark.parametrize("module", MODULES)
def test_a_benchmark_finds_what_it_asks_for(module):
    importlib.import_module(f"tests.benchmarks.{module}")
