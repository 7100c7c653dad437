"""The wheel claims one name, and everything in it imports by that name from anywhere."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import hatch_build

HOUSE = Path(__file__).resolve().parents[1]
ASK = """
import importlib, multiprocessing, pkgutil, sys
import levimass

def everything():
    assert not {"numpy", "numba"} & set(sys.modules), "importing the package is quick"
    for module in pkgutil.walk_packages(levimass.__path__, "levimass."):
        if not module.name.startswith("levimass.app.window."):
            importlib.import_module(module.name)
    from levimass.analysis.compiled import kernel_cache
    from levimass.instrument.background import lower_priority
    from levimass.instrument.devices.device_search import udev_rule_path
    from levimass.instrument.devices.sources import SOURCES, import_function
    assert all(callable(import_function(source.opener)) for source in SOURCES)
    own = {"app", "analysis", "instrument", "resources"}
    assert not own & {name.split(".")[0] for name in sys.modules}
    assert levimass.analysis.__file__.startswith(sys.argv[1])
    assert udev_rule_path().is_file()
    closure = kernel_cache.closure("levimass.analysis.collision.solver.rates")
    assert {"levimass.analysis.collision.effects.kernel", "levimass.analysis.compiled.kernel_parts"} <= set(closure)
    child = multiprocessing.get_context("spawn").Process(target=lower_priority, args=(1,))
    child.start(); child.join(60)
    assert child.exitcode == 0

if __name__ == "__main__":
    everything()
"""


def test_the_package_of_the_wheel_works_under_its_one_name(tmp_path: Path) -> None:
    hatch_build.write_package(HOUSE, tmp_path / "site" / "levimass")
    script = tmp_path / "ask.py"
    script.write_text(ASK)
    elsewhere = tmp_path / "elsewhere"
    for name in hatch_build.PARTS:  # a physicist's own files of these names are no concern of ours
        (elsewhere / name).mkdir(parents=True)
        (elsewhere / name / "__init__.py").write_text("raise SystemExit(9)\n")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    command = [sys.executable, str(script), str(tmp_path / "site")]
    done = subprocess.run(command, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "text", ["import analysis\n", "import analysis.shot.shot\n", "x = 'app.session.jobs'\n", "if x: import app as a\n"]
)
def test_what_has_no_name_in_the_wheel_stops_the_build(text: str) -> None:
    with pytest.raises(ValueError, match="has no name in the wheel"):
        hatch_build.renamed(text, "somewhere")


def test_imports_are_named() -> None:
    text = "from analysis.shot.shot import Shot\nimport app.cli as c\nfrom importlib import resources\n"
    assert hatch_build.renamed(text, "").splitlines() == [
        "from levimass.analysis.shot.shot import Shot",
        "import levimass.app.cli as c",
        "from importlib import resources",
    ]
