"""``python -m tests.app.virtual_screen PICTURES [light|dark] [brief] [2]``: the whole session on its own screen (Xvfb).

The last word scales everything, as on a dense screen: 2 takes 2960 x 1840 pixels.  Needs Xvfb and the libraries of
Qt's xcb platform that the README lists.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SIZE = (1480, 920)
HOUSE = Path(__file__).resolve().parents[2]


def why_reversed() -> str | None:
    """Return why there can be no virtual screen here, or None."""
    return None if shutil.which("Xvfb") else "Xvfb is not installed (Debian: apt install xvfb)"


@contextmanager
def virtual_screen(scale: int = 1) -> Iterator[str]:
    """Start a screen and yield its DISPLAY."""
    width, height = (scale * side for side in SIZE)
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=(writing,), stderr=subprocess.DEVNULL) as server:
        os.close(writing)
        try:
            with os.fdopen(reading) as told:
                yield f":{told.readline().strip()}"
        finally:
            server.terminate()


def play(pictures: Path, *words: str, scale: int = 1, timeout_s: float = 3600.0) -> subprocess.CompletedProcess[str]:
    """Play the whole session with a home of its own; kernels are taken from this user's cache."""
    from platformdirs import user_cache_path

    with tempfile.TemporaryDirectory(prefix="levimass-") as folder, virtual_screen(scale) as display:
        home = Path(folder)
        own = {"HOME": folder, "XDG_CONFIG_HOME": str(home / "config"), "XDG_CACHE_HOME": str(user_cache_path())}
        own |= {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "QT_SCALE_FACTOR": str(scale)}
        own |= {"LEVIMASS_SESSION_HOME": folder, "PYTHONPATH": str(HOUSE)}
        command = [sys.executable, "-m", "tests.app.whole_session", str(pictures.resolve()), *words]
        return subprocess.run(
            command, env=os.environ | own, cwd=HOUSE, stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True,
            timeout=timeout_s, check=False,
        )  # fmt: skip


def main(arguments: list[str]) -> int:
    """Play it and say how it ended."""
    if not arguments:
        print(__doc__, file=sys.stderr)
        return 2
    problem = why_reversed()
    if problem is not None:
        print(f"virtual_screen: {problem}", file=sys.stderr)
        return 1
    words = [word for word in arguments[1:] if word != "2"]
    ended = play(Path(arguments[0]), *words, scale=2 if "2" in arguments[1:] else 1)
    print(ended.stdout, end="")
    return ended.returncode


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
