"""The command ``levimass``: run the window or a headless command; handle exit status, Ctrl-C and broken pipes.

Modules that only one command needs are imported by that command.
"""

import argparse
import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

from app.command_line.options import FAILED, INTERRUPTED, OK
from app.command_line.parser import command_of, parse, settings_from
from app.words import EscapingStream

if TYPE_CHECKING:
    from analysis.planning import Reach

Run = Callable[[], int]


def prepared_command(options: argparse.Namespace, arguments: Sequence[str]) -> Run:
    """Import a command's modules and return the function that runs it; that function returns the exit status."""
    match command_of(options):
        case "replay":
            return _replay(options)
        case "acquire":
            return _acquire(options)
        case "simulate":
            from app.command_line.acquire import simulate

            how = {name: getattr(options, name) for name in ("shots", "seed", "effect", "undeclared", "site")}
            return partial(simulate, options.simulate, **how)
        case "map":
            from app.command_line.map_foreign import MapOptions, map_foreign

            given = MapOptions(
                options.mass, options.rate, options.rest, options.wavelength, options.bits, options.unit, options.model
            )
            roles = options.channel, options.volts
            return partial(map_foreign, options.map, *roles, given, for_folder=options.for_folder)
        case "paper":
            from app.command_line.paper import paper

            return partial(paper, options.json, options.figures, options.paper or None)
        case "prepare":
            from app.command_line.doctor import prepare

            return partial(prepare, options.jobs)
        case "doctor":
            from app.command_line.doctor import doctor

            return partial(doctor, source=options.source, bundle=options.bundle)
    return partial(window, arguments, site=options.site)


def window(argv: Sequence[str] | None = None, *, site: str | None = None) -> int:
    """Open the desktop application; ``site`` is the floor vibration of its simulated bench, default: the settings'."""
    from app.window import run

    return run(list(sys.argv[1:] if argv is None else argv), site)


def reach_of(options: argparse.Namespace) -> "Reach":
    """Return the rig's possible speeds, weights and run-up from the options, else the planning's defaults.

    The window's settings are not used, so that a command gives the same result on every machine.
    """
    from analysis.planning import Reach

    usual = Reach()
    return Reach(
        options.speeds or usual.speeds_m_per_s,
        tuple(sorted({0.0, *options.weights})) if options.weights is not None else usual.added_kg,
        options.run_up or usual.run_up_m,
    )


def _replay(options: argparse.Namespace) -> Run:
    from app.command_line.outputs import Outputs

    outputs = Outputs(options.json, options.export, options.hdf5, options.report, options.save_model)
    how = {"model": options.model, "settings": settings_from(options), "checked": not options.unchecked}
    if options.jobs is not None or options.scheduler is not None:
        from app.command_line.run_campaign import campaign

        how |= {name: getattr(options, name) for name in ("jobs", "scheduler", "insecure")}
        return partial(campaign, options.replay, outputs, **how)
    from app.command_line.replay import ReplayRequest, replay

    request = ReplayRequest(
        diagnosis=not options.no_diagnose,
        laws=tuple(options.law or ()),
        test_model=options.foretell,
        plan=options.plan,
        reach=reach_of(options) if options.plan is not None else None,
    )
    return partial(replay, options.replay, request, outputs, **how)


def _acquire(options: argparse.Namespace) -> Run:
    from app.command_line.acquire import CaptureRequest, acquire
    from instrument.devices import with_site

    source = options.source if options.site is None else with_site(options.source, options.site)
    request = CaptureRequest(source, options.out, options.rate, options.samples, options.timeout)
    if options.resolve is None:
        return partial(acquire, options.acquire, request)
    from app.command_line.resolve import resolve

    return partial(resolve, options.acquire, options.resolve, request, options.json, reach_of(options))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status: 0 success, 1 something failed, 2 wrong usage, 130 interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a character unknown to the terminal must not raise
        sys.stdout.reconfigure(errors="backslashreplace")
    with _plain_streams():
        return _status(arguments)


def _status(arguments: Sequence[str]) -> int:
    try:
        with _ended_by_ctrl_c():
            run = prepared_command(parse(list(arguments)), arguments)
        status = run()
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except SystemExit as stop:
        return int(stop.code or 0)
    except KeyboardInterrupt:
        print("levimass: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of a pipe has closed it
        _drop_output()
        return OK
    except OSError as error:
        if error.filename is not None:
            raise
        print(f"levimass: standard output: {error.strerror or error}", file=sys.stderr)
        _drop_output()
        return FAILED


@contextlib.contextmanager
def _plain_streams() -> Iterator[None]:
    """Escape control characters of file names and notes before they reach a terminal."""
    with contextlib.ExitStack() as undo:
        for stream, redirect in (
            (sys.stdout, contextlib.redirect_stdout),
            (sys.stderr, contextlib.redirect_stderr),
        ):
            if stream is not None:  # None in a program without a console
                undo.enter_context(redirect(EscapingStream(stream)))  # type: ignore[type-var]
        yield


@contextlib.contextmanager
def _ended_by_ctrl_c() -> Iterator[None]:
    """Let Ctrl-C end the process at once during imports, because an interrupted import may raise any exception."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _drop_output() -> None:
    """Redirect standard output to nowhere, so that the interpreter does not fail on its buffer at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
