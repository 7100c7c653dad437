"""What each command does with its options; what it needs is imported when it is asked for."""

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from app.command_line.options import WINDOW
from app.command_line.parser import command_of, settings_from

if TYPE_CHECKING:
    from analysis.planning.next_shot import Reach

Run = Callable[[], int]


def run_of(options: argparse.Namespace, arguments: Sequence[str]) -> Run:
    """Return what is asked for, its modules imported; it returns the exit status."""
    if (command := command_of(options)) == WINDOW:
        return partial(window, arguments, site=options.site)
    return _MODES[command](options)


def window(argv: Sequence[str] | None = None, *, site: str | None = None) -> int:
    """Open the desktop application; its simulated bench stands at ``site``, else where the settings say."""
    from app.window.main_window import run

    return run(list(sys.argv[1:] if argv is None else argv), site)


def reach_of(options: argparse.Namespace) -> "Reach":
    """Return what the rig can do as the options say, else as the planning takes it.

    A call gives the same answer to everybody: it takes none of this from a person's settings, which are the window's.
    """
    from analysis.planning.next_shot import Reach

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
        from app.command_line.campaign.run import Workers, campaign

        workers = Workers(options.jobs, options.scheduler, options.insecure)
        return partial(
            campaign,
            options.replay,
            workers,
            outputs,
            model=options.model,
            settings=settings_from(options),
            checked=not options.unchecked,
        )
    from app.command_line.replay import Asked, replay

    planned = options.plan is not None
    asked = Asked(
        diagnosis=not options.no_diagnose,
        laws=tuple(options.law or ()),
        foretell=options.foretell,
        plan=options.plan,
        reach=reach_of(options) if planned else None,
    )
    return partial(
        replay,
        options.replay,
        asked,
        outputs,
        model=options.model,
        settings=settings_from(options),
        checked=not options.unchecked,
    )


def _acquire(options: argparse.Namespace) -> Run:
    from app.command_line.acquire import Taking, acquire
    from instrument.devices.sources import at_site

    source = options.source if options.site is None else at_site(options.source, options.site)
    taking = Taking(source, options.out, options.rate, options.samples, options.timeout)
    if options.resolve is None:
        return partial(acquire, options.acquire, taking)
    from app.command_line.resolve import resolve

    return partial(resolve, options.acquire, options.resolve, taking, options.json, reach_of(options))


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
    from app.command_line.map_foreign import Given, map_foreign

    given = Given(
        options.mass, options.rate, options.rest, options.wavelength, options.bits, options.unit, options.model
    )
    return partial(map_foreign, options.map, options.channel, options.volts, given, for_folder=options.for_folder)


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
