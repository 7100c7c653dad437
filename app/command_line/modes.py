"""Run each command with its options; what a command needs is imported only for it."""

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from app.command_line.options import WINDOW
from app.command_line.parser import command_of, settings_from

if TYPE_CHECKING:
    from analysis.planning import Reach

Run = Callable[[], int]


def run_of(options: argparse.Namespace, arguments: Sequence[str]) -> Run:
    """Return the function that runs the command, its modules imported; that returns the exit status."""
    if (command := command_of(options)) == WINDOW:
        return partial(window, arguments, site=options.site)
    return _MODES[command](options)


def window(argv: Sequence[str] | None = None, *, site: str | None = None) -> int:
    """Open the desktop application; its simulated bench stands at ``site``, else as in the settings."""
    from app.window import run

    return run(list(sys.argv[1:] if argv is None else argv), site)


def reach_of(options: argparse.Namespace) -> "Reach":
    """Return what the rig can do: from the options, else the planning's defaults.

    The settings of the window do not count here, so that a command gives everybody the same answer.
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
    if options.jobs is not None or options.scheduler is not None:
        from app.command_line.campaign.run import WorkerChoice, campaign

        workers = WorkerChoice(options.jobs, options.scheduler, options.insecure)
        return partial(
            campaign,
            options.replay,
            workers,
            outputs,
            model=options.model,
            settings=settings_from(options),
            checked=not options.unchecked,
        )
    from app.command_line.replay import ReplayRequest, replay

    request = ReplayRequest(
        diagnosis=not options.no_diagnose,
        laws=tuple(options.law or ()),
        test_model=options.foretell,
        plan=options.plan,
        reach=reach_of(options) if options.plan is not None else None,
    )
    return partial(
        replay,
        options.replay,
        request,
        outputs,
        model=options.model,
        settings=settings_from(options),
        checked=not options.unchecked,
    )


def _acquire(options: argparse.Namespace) -> Run:
    from app.command_line.acquire import CaptureRequest, acquire
    from instrument.devices import at_site

    source = options.source if options.site is None else at_site(options.source, options.site)
    request = CaptureRequest(source, options.out, options.rate, options.samples, options.timeout)
    if options.resolve is None:
        return partial(acquire, options.acquire, request)
    from app.command_line.resolve import resolve

    return partial(resolve, options.acquire, options.resolve, request, options.json, reach_of(options))


def _simulate(options: argparse.Namespace) -> Run:
    from app.command_line.acquire import simulate

    return partial(
        simulate,
        options.simulate,
        shots=options.shots,
        seed=options.seed,
        effect=options.effect,
        undeclared=options.undeclared,
        site=options.site,
    )


def _map(options: argparse.Namespace) -> Run:
    from app.command_line.map_foreign import MapOptions, map_foreign

    mapping = MapOptions(
        options.mass, options.rate, options.rest, options.wavelength, options.bits, options.unit, options.model
    )
    return partial(map_foreign, options.map, options.channel, options.volts, mapping, for_folder=options.for_folder)


def _paper(options: argparse.Namespace) -> Run:
    from app.command_line.paper import paper

    return partial(paper, options.json, options.figures, options.paper or None)


def _prepare(options: argparse.Namespace) -> Run:
    from app.command_line.doctor import prepare

    return partial(prepare, options.jobs)


def _doctor(options: argparse.Namespace) -> Run:
    from app.command_line.doctor import doctor

    return partial(doctor, source=options.source, bundle=options.bundle)


_MODES: dict[str, Callable[[argparse.Namespace], Run]] = {
    "replay": _replay,
    "acquire": _acquire,
    "simulate": _simulate,
    "map": _map,
    "paper": _paper,
    "prepare": _prepare,
    "doctor": _doctor,
}
