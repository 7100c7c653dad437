"""Every kind of attack, a few attempts of each; at length: make attack."""

from pathlib import Path

import pytest

from tests.attack.kinds import KINDS
from tests.attack.trial import carry_out

FEW = {
    "claims": 30, "moving data": 8, "spoilt": 2, "texts": 200, "travelling": 6, "foreign": 12, "scopes": 12, "usb": 6,
    "ni": 20, "clocks": 1, "sessions": 2,
    "untrue": 4, "records": 1, "models": 6, "laws": 2, "planted": 1, "journals": 200,
}  # fmt: skip


@pytest.mark.parametrize("name", FEW)
def test_a_few_of_each(name: str, tmp_path: Path) -> None:
    if name == "foreign":
        pytest.importorskip("h5py", reason="the extra 'hdf5' is not installed")
        pytest.importorskip("nptdms", reason="the extra 'tdms' is not installed")
    KINDS[name].warm(tmp_path / "warm")  # compiling, on a fresh machine, is no attempt's doing
    outcome = carry_out(name, KINDS[name].attack, tmp_path / "trial", FEW[name], seed=7)
    assert outcome.failed == [] and outcome.tried == FEW[name]
    assert outcome.survived + outcome.refused == outcome.tried
