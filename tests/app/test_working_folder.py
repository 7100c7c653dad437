"""Code that happens to lie in the working folder is never run."""

import os
import subprocess
import sys
from pathlib import Path

HOUSE = Path(__file__).resolve().parents[2]
NAMES = ("app", "analysis", "instrument", "resources", "multiprocessing", "pickle", "numpy", "PySide6")


def test_children_do_not_look_into_the_working_folder(tmp_path: Path) -> None:
    """As the installed command: a script that lies elsewhere, started in a folder of somebody else's Python files."""
    folder, told = tmp_path / "folder", tmp_path / "told"
    for name in NAMES:
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text(f"open({str(told)!r}, 'a').write({name!r})\nraise SystemExit(9)\n")
    script = tmp_path / "bin" / "levimass"
    script.parent.mkdir()
    script.write_text(
        f"import sys\nsys.path.append({str(HOUSE)!r})\nfrom app.command_line.cli import main\n"
        "if __name__ == '__main__':\n    raise SystemExit(main())\n"
    )
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONSAFEPATH", "PYTHONPATH")}
    command = [sys.executable, str(script), "--doctor", "--source", "bench"]  # asks Qt, and a digitizer, in children
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert not told.exists(), told.read_text() + done.stdout
    assert "window: Qt starts" in done.stdout, done.stderr
    assert "signal, " in done.stdout, done.stdout + done.stderr
