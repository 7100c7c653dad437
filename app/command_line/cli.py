"""The command ``levimass``: the window where nothing else is asked for, and every mode that needs no screen."""

import argparse
import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from app.command_line.model_choice import MODELS, is_model_file
from app.command_line.reach_options import add_reach, check_reach, reach_of
from app.words.plain import PlainStream

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status (0 analysed, 1 something failed, 2 wrong usage)."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):  # "±", or a name that is no text, must not cost a script its result
        sys.stdout.reconfigure(errors="backslashreplace")
    with _plain_streams():
        return _status(arguments)


def _status(arguments: Sequence[str]) -> int:
    try:
        with _ended_by_ctrl_c():
            work = _work(arguments)
        status = work()
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except SystemExit as stop:
        return int(stop.code or 0)
    except KeyboardInterrupt:
        print("levimass: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader has seen enough
        _drop_output()
        return OK
    except OSError as error:
        if error.filename is not None:
            raise
        print(f"levimass: standard output: {error.strerror or error}", file=sys.stderr)
        _drop_output()
        return FAILED


def window(argv: Sequence[str] | None = None, *, site: str | None = None) -> int:
    """Open the desktop application; its simulated bench stands at ``site``, else where the settings say."""
    from app.window.main_window import run

    return run(list(sys.argv[1:] if argv is None else argv), site)


@contextlib.contextmanager
def _plain_streams() -> Iterator[None]:
    """Let nothing that stands in a file's name or note be obeyed by the terminal it is shown on."""
    with contextlib.ExitStack() as undo:
        for stream, redirect in (
            (sys.stdout, contextlib.redirect_stdout),
            (sys.stderr, contextlib.redirect_stderr),
        ):
            if stream is not None:  # a program without a console has none
                undo.enter_context(redirect(PlainStream(stream)))  # type: ignore[type-var]
        yield


@contextlib.contextmanager
def _ended_by_ctrl_c() -> Iterator[None]:
    """Let Ctrl-C end the process at once: nothing is under way yet, and an import cut short raises what it likes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _drop_output() -> None:
    """Keep the interpreter from trying once more, at its end, to write what could not be written."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _work(arguments: Sequence[str]) -> Callable[[], int]:
    """Return what the arguments ask for, its modules imported.  Raises SystemExit on wrong usage."""
    parser = _parser()
    options = parser.parse_args(arguments)
    _check(parser, options)
    return _mode(options, arguments)


def _mode(options: argparse.Namespace, arguments: Sequence[str]) -> Callable[[], int]:
    if options.replay is not None and (options.jobs is not None or options.scheduler is not None):
        from app.command_line.campaign.run import campaign

        return partial(
            campaign,
            options.replay,
            jobs=options.jobs,
            scheduler=options.scheduler,
            json_to=options.json,
            export_to=options.export,
            model=options.model,
            checked=not options.unchecked,
            fit_seconds=options.fit_seconds,
            insecure=options.insecure,
        )
    if options.replay is not None:
        from app.command_line.outputs import Outputs
        from app.command_line.replay import replay

        return partial(
            replay,
            options.replay,
            outputs=Outputs(options.json, options.export, options.hdf5, options.report, options.save_model),
            diagnose=not options.no_diagnose,
            model=options.model,
            foretell=options.foretell,
            laws=options.law or (),
            checked=not options.unchecked,
            plan=options.plan,
            reach=reach_of(options) if options.plan is not None else None,
            fit_seconds=options.fit_seconds,
            diagnosis_seconds=options.diagnosis_seconds,
        )
    if options.acquire is not None:
        from app.command_line.acquire import acquire

        source = options.source if options.site is None else _at_site(options.source, options.site)
        if options.resolve is not None:
            from app.command_line.resolve import Taking, resolve

            taking = Taking(source, options.out, options.rate, options.samples, options.timeout)
            return partial(resolve, options.acquire, options.resolve, taking, options.json, reach_of(options))
        return partial(
            acquire,
            options.acquire,
            source=source,
            out=options.out,
            rate_hz=options.rate,
            samples=options.samples,
            timeout_s=options.timeout,
        )
    if options.simulate is not None:
        from app.command_line.simulate import simulate

        return partial(
            simulate,
            options.simulate,
            shots=options.shots,
            seed=options.seed,
            effect=options.effect,
            undeclared=options.undeclared,
            site=options.site,
        )
    if options.map is not None:
        from app.command_line.map_foreign import map_foreign

        return partial(
            map_foreign,
            options.map,
            channels=options.channel,
            volts=options.volts,
            mass_kg=options.mass,
            rate_hz=options.rate,
            rest_hz=options.rest,
            wavelength_m=options.wavelength,
            bits=options.bits,
            for_folder=options.for_folder,
        )
    if options.paper is not None:
        from app.command_line.paper import paper

        return partial(paper, options.json, options.figures, options.paper or None)
    if options.prepare:
        from app.command_line.prepare import prepare

        return partial(prepare, options.jobs)
    if options.doctor:
        from app.command_line.doctor import doctor

        return partial(doctor, source=options.source, bundle=options.bundle)
    return partial(window, arguments, site=options.site)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="levimass",
        description="Levitation Mass Method: from the beat of two light frequencies to force and restitution. "
        "Without an option the desktop window opens.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print version, licence and what it works with")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--replay", nargs="+", metavar="PATH", type=_path, help="analyse recordings (files or folders)")
    mode.add_argument(
        "--acquire", type=_positive_int, metavar="N", help="arm, wait for the light switch, record N shots"
    )
    mode.add_argument("--simulate", type=_path, metavar="DIR", help="write recordings from the simulated bench")
    mode.add_argument(
        "--paper",
        nargs="?",
        const=False,
        type=_path,
        metavar="RECORDING",
        help="print the paper's numbers beside this program's (and beside a recording's)",
    )
    mode.add_argument("--map", type=_path, metavar="FILE", help="what a TDMS, HDF5, WAV or CSV file holds, and its use")
    mode.add_argument("--prepare", action="store_true", help="compile everything now, for the first start (--jobs N)")
    mode.add_argument("--doctor", action="store_true", help="check this machine, with --source its signals too")
    group = parser.add_argument_group("with --doctor")
    group.add_argument("--bundle", type=_path, metavar="FILE", help="write checks, settings and log for support (ZIP)")
    group = parser.add_argument_group("with --replay")
    group.add_argument("--json", metavar="FILE", type=_name, help="write the result (- for standard output)")
    group.add_argument("--export", type=_path, metavar="DIR", help="write CSV: one motion file a shot, and shots.csv")
    group.add_argument("--hdf5", action="store_true", help="with --export: a motion file a shot in HDF5 too")
    group.add_argument("--report", type=_path, metavar="FILE", help="write a report that prints: one HTML file")
    group.add_argument("--no-diagnose", action="store_true", help="stop after the base model's fit")
    group.add_argument(
        "--plan",
        nargs="?",
        const="",
        metavar="PARAMETER",
        help="which shots to take next: those that decide, or that make a parameter (or all) twice as sure",
    )
    group.add_argument("--unchecked", action="store_true", help="leave out the comparison of data and SHA-512 (faster)")
    group.add_argument(
        "--fit-seconds", type=_positive, metavar="S", help="longest that the fit of one shot may take (20)"
    )
    group.add_argument(
        "--diagnosis-seconds",
        type=_positive,
        metavar="S",
        help="time after which a diagnosis leaves out other ways and laws, and says so (60)",
    )
    group.add_argument(
        "--model", metavar="NAME", help=f"base model: {', '.join(MODELS)} (default: paper), or a model file (.toml)"
    )
    group.add_argument(
        "--foretell", action="store_true", help="put the model file to the test: unchanged, on these shots"
    )
    group.add_argument(
        "--law",
        type=_path,
        action="append",
        metavar="FILE",
        help="a law of one's own (TOML) that the diagnosis asks, too",
    )
    group.add_argument("--save-model", type=_path, metavar="FILE", help="write the model that the diagnosis arrived at")
    group.add_argument("--jobs", type=_positive_int, metavar="N", help="a campaign over N processes, resumable")
    group.add_argument("--scheduler", metavar="ADDRESS", help="a campaign over the machines of a dask scheduler")
    group.add_argument("--insecure", action="store_true", help="with --scheduler: one elsewhere, and without TLS")
    group = parser.add_argument_group("with --paper (and --json)")
    group.add_argument("--figures", type=_path, metavar="DIR", help="draw figures 4 to 7, PNG and SVG")
    group = parser.add_argument_group("with --acquire")
    group.add_argument(
        "--source", metavar="SOURCE", help="bench, replay:PATH, hantek6022, scpi:ADDRESS or niscope:RESOURCE"
    )
    group.add_argument("--out", type=_path, metavar="DIR", help="folder for the recordings")
    group.add_argument("--rate", type=_positive, metavar="HZ", help="sample rate")
    group.add_argument("--samples", type=_positive_int, metavar="N", help="samples a channel and shot")
    group.add_argument("--timeout", type=_positive, metavar="S", default=60.0, help="longest wait for a shot (60)")
    group.add_argument(
        "--resolve", type=_positive_int, metavar="M", help="diagnose, and take up to M shots that decide (--json FILE)"
    )
    add_reach(parser)
    group = parser.add_argument_group("with --map (and --rate)")
    group.add_argument("--channel", action="append", metavar="ROLE=NAME", help="measurement, reference or switch")
    group.add_argument("--volts", action="append", metavar="ROLE=VOLTS", help="volts of one stored unit")
    group.add_argument("--mass", type=_positive, metavar="KG", help="mass of the moving part")
    group.add_argument("--rest", type=_positive, metavar="HZ", help="rest frequency, where no channel is the reference")
    group.add_argument("--wavelength", type=_positive, metavar="M", help="wavelength in air (632.8e-9)")
    group.add_argument("--bits", type=_positive_int, metavar="N", help="bits of the digitizer, where counts are stored")
    group.add_argument("--for-folder", action="store_true", help="for every file of this format in the folder")
    group = parser.add_argument_group("with --simulate")
    group.add_argument("--shots", type=_positive_int, default=3, metavar="N", help="shots to simulate (3)")
    group.add_argument("--seed", type=_whole, default=1, metavar="S", help="seed of the draw (1)")
    group.add_argument("--effect", metavar="NAME:PARAMETER=VALUE,...", help="an effect the base model lacks")
    group.add_argument("--undeclared", action="store_true", help="draw an effect, or none, that is not told")
    group = parser.add_argument_group("the simulated bench: with --simulate, --acquire --source bench, or the window")
    group.add_argument(
        "--site",
        type=_name,
        metavar="SITE",
        help="where it stands: quiet, ISO-office, VC-A to VC-G, or a TOML file (quiet; in the window as set)",
    )
    return parser


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse options that would otherwise be passed over in silence."""
    names = ["json", "export", "report", "model", "law", "save_model", "jobs", "scheduler"]
    names += ["fit_seconds", "diagnosis_seconds"]
    given = {name for name in names if getattr(options, name) is not None}
    given |= {"no-diagnose"} if options.no_diagnose else set()
    given |= {"plan"} if options.plan is not None else set()
    given |= {"unchecked"} if options.unchecked else set()
    if options.paper is not None:
        given -= {"json"}
    if options.prepare:
        given -= {"jobs"}
    if options.resolve is not None:
        given -= {"json"}
        if options.acquire is None:
            parser.error("--resolve goes with --acquire")
    check_reach(parser, options)
    if given and options.replay is None:
        parser.error(f"--{sorted(given)[0].replace('_', '-')} goes with --replay")
    if options.insecure and options.scheduler is None:
        parser.error("--insecure goes with --scheduler")
    if options.hdf5 and options.export is None:
        parser.error("--hdf5 goes with --export")
    mapping = ("channel", "volts", "mass", "rest", "wavelength", "bits")
    if options.map is None and (options.for_folder or any(getattr(options, name) is not None for name in mapping)):
        parser.error("--channel, --volts, --mass, --rest, --wavelength, --bits and --for-folder go with --map")
    if options.figures is not None and options.paper is None:
        parser.error("--figures goes with --paper")
    if options.model is not None and options.model not in MODELS and not is_model_file(options.model):
        parser.error(f"--model: no model called {options.model!r}; there are {', '.join(MODELS)}")
    if options.foretell and (options.replay is None or options.model is None or not is_model_file(options.model)):
        parser.error("--foretell goes with --replay and --model FILE: it puts that file's model to the test")
    if options.save_model is not None and options.no_diagnose:
        parser.error("--save-model writes what a diagnosis arrived at: leave --no-diagnose out")
    if options.jobs is not None and options.scheduler is not None:
        parser.error("--jobs and --scheduler: one of them")
    if options.diagnosis_seconds is not None and (options.no_diagnose or options.jobs is not None):
        parser.error("--diagnosis-seconds is for a diagnosis: leave --no-diagnose and --jobs out")
    if options.law is not None and options.no_diagnose:
        parser.error("--law is asked by the diagnosis: leave --no-diagnose out")
    if options.plan is not None and options.no_diagnose:
        parser.error("--plan begins with what a diagnosis left open: leave --no-diagnose out")
    plans = options.plan is not None
    of_one_call = any((options.report, options.hdf5, options.save_model, options.foretell, options.law, plans))
    if of_one_call and (options.jobs is not None or options.scheduler is not None):
        listed = "--report, --hdf5, --foretell, --law, --plan and --save-model"
        parser.error(f"{listed} are of one call's shots: leave --jobs and --scheduler out")
    if options.acquire is not None:
        if options.source is None:
            parser.error("--acquire needs --source")
        if options.out is None:
            parser.error("--acquire needs --out")
    elif options.out is not None or (options.source is not None and not options.doctor):
        parser.error("--source and --out go with --acquire, --source with --doctor too")
    if options.bundle is not None and not options.doctor:
        parser.error("--bundle goes with --doctor")
    if options.simulate is None and (options.effect is not None or options.undeclared):
        parser.error("--effect and --undeclared go with --simulate")
    if options.site is not None:
        _check_site(parser, options)
    if options.effect is not None and options.undeclared:
        parser.error("--undeclared draws the effect itself: leave --effect out")


def _is_bench(source: str) -> bool:
    from instrument.sources import is_bench

    return is_bench(source)


def _at_site(source: str, site: str) -> str:
    from instrument.sources import at_site

    return at_site(source, site)


def _check_site(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    elsewhere = any(mode is not None for mode in (options.replay, options.map, options.paper, options.doctor or None))
    if elsewhere or (options.acquire is not None and not _is_bench(options.source)):
        parser.error("--site is where the simulated bench stands: with --simulate, --acquire --source bench or alone")
    from instrument.bench.site import site_named

    try:
        site_named(options.site)
    except ValueError as error:
        parser.error(f"--site: {error}")


class _Version(argparse.Action):
    """Print the version; what knows it is imported only then, and nothing that compiles."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from app.command_line.version import version_text

        print(version_text())
        parser.exit()


def _name(text: str) -> str:
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"{text!r} names no file or folder")  # a script's variable that was never set
    return text


def _path(text: str) -> Path:
    return Path(_name(text))


def _whole(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below zero")
    return value


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def _positive_int(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive whole number")
    return value


if __name__ == "__main__":
    raise SystemExit(main())
