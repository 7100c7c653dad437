"""``--speeds``, ``--weights``, ``--run-up``: what the rig can do, for the planning of shots.

A call gives the same answer to everybody: it takes none of this from a person's settings, which are the window's.
"""

import argparse
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.planning.next_shot import Reach

NAMES = ("speeds", "weights", "run_up")


def add_reach(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    group = parser.add_argument_group(
        "what the rig can do: with --plan or --resolve (else 0.05 to 0.6 m/s, 50 g, 12 mm)"
    )
    group.add_argument("--speeds", type=_numbers, metavar="M/S,...", help="speeds that a planned shot may have")
    group.add_argument(
        "--weights", type=_numbers, metavar="KG,...", help="weights to put on the block, each whole; 0: none"
    )
    group.add_argument("--run-up", type=_length, metavar="M", help="free flight before the plate")


def check_reach(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse the options where nothing is planned, and speeds of nothing."""
    if options.plan is None and options.resolve is None and any(getattr(options, name) is not None for name in NAMES):
        parser.error("--speeds, --weights and --run-up go with --plan or --resolve")
    if options.speeds is not None and min(options.speeds) == 0.0:
        parser.error("--speeds: a block that stands strikes nothing")


def reach_of(options: argparse.Namespace) -> "Reach":
    """Return what the rig can do as the options say, else as the planning takes it."""
    from analysis.planning.next_shot import Reach

    usual = Reach()
    return Reach(
        options.speeds or usual.speeds_m_per_s,
        tuple(sorted({0.0, *options.weights})) if options.weights is not None else usual.added_kg,
        options.run_up or usual.run_up_m,
    )


def _numbers(text: str) -> tuple[float, ...]:
    try:
        found = sorted({float(part) for part in text.split(",")})
    except ValueError:
        found = []
    if not found or not all(math.isfinite(value) and value >= 0.0 for value in found):
        raise argparse.ArgumentTypeError(f"{text!r} is no list of numbers such as 0.05,0.2")
    return tuple(found)


def _length(text: str) -> float:
    (value, *rest) = _numbers(text)
    if rest or value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no length in m")
    return value
