"""``make run``: the window on the simulated bench, or, where no window can open, one simulated shot in the terminal."""

import sys
import tempfile
from pathlib import Path

from app.command_line.cli import window
from app.command_line.display import why_no_window
from instrument.bench.site import USUAL_SITE, site_named


def main() -> int:
    """Open the window where there is a display; run one shot headless where there is none."""
    problem = why_no_window()
    if problem is None:
        return window([])
    print(f"levimass: no window here ({problem}); one simulated shot without it:\n", file=sys.stderr)
    return headless_shot()


def headless_shot() -> int:
    """Simulate one shot in a usual laboratory, analyse it and print its numbers."""
    from app.command_line.prepare import progress_lines
    from app.command_line.replay import replay
    from app.session.prepare import prepare_first_shot
    from instrument.bench.simulate import simulate

    prepare_first_shot(progress_lines())
    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        return replay(simulate(Path(folder), 1, site=site_named(USUAL_SITE)), diagnose=False)


if __name__ == "__main__":
    raise SystemExit(main())
