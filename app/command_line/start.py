"""``make run``: open the window or, if no window can open, analyse one simulated shot in the terminal."""

import sys
import tempfile
import threading
from pathlib import Path

from app.command_line.cli import window
from app.command_line.machine import why_no_window
from instrument.bench import USUAL_SITE, site_named


def main() -> int:
    """Open the window, or analyse one shot headless if no window can open."""
    problem = why_no_window()
    if problem is None:
        return window([])
    print(f"levimass: no window can open ({problem}); analysing one simulated shot instead:\n", file=sys.stderr)
    return headless_shot()


def headless_shot() -> int:
    """Simulate one shot at the usual site and print its readings, then its fit."""
    from analysis.pipeline import fitted, read
    from analysis.uncertainty import combined_uncertainties
    from app.command_line.doctor import progress_lines
    from app.command_line.outputs import say_problem
    from app.report import fit_lines, summary
    from app.session import Stage, prepare_first_shot
    from app.words import by_severity, flag_words
    from instrument.background import beside
    from instrument.bench import simulate
    from instrument.files import open_recording

    ready = {stage: threading.Event() for stage in (Stage.READINGS, Stage.FIT)}
    compiling = beside("kernels", lambda _, __: prepare_first_shot(progress_lines(), lambda stage: ready[stage].set()))
    with compiling, tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        ready[Stage.READINGS].wait()
        (path,) = simulate(Path(folder), 1, site=site_named(USUAL_SITE))
        shot = read(open_recording(path))
        print(summary(shot), flush=True)
        ready[Stage.FIT].wait()
        read_flags, shot = shot.flags, fitted(shot)
    if shot.fit is not None and shot.fit.converged:
        print("\n".join(fit_lines(shot.fit, combined_uncertainties(shot))))
    for flag in by_severity(flag for flag in shot.flags if flag not in read_flags):
        print(f"  {flag}: {flag_words(flag)}")
    say_problem(shot)
    return 1 if shot.problem or shot.fit_problem else 0


if __name__ == "__main__":
    raise SystemExit(main())
