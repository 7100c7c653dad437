"""Every kind of attack, how often it is tried at length, and what is loaded before its memory is counted."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.shot.recording import Channel, Gap, Recording, Role, Setup
from analysis.shot.shot import AnalysisSettings
from app.session.load import load_and_analyse
from instrument.bench.simulated_shots import simulate
from instrument.live.live_thread import warm
from tests.attack.crowds import folders, kills, sessions
from tests.attack.cut_off import outputs
from tests.attack.devices import clocks, ni_cards, usb_devices
from tests.attack.extremes import laws, models, records
from tests.attack.foreign import foreign
from tests.attack.planted import journals, planted
from tests.attack.recordings import analysed, claims, moving_data
from tests.attack.scopes import scopes
from tests.attack.texts import texts, travelling
from tests.attack.trial import HANGS_S, SURVIVED, Attack, Attempt, Outcome, carry_out
from tests.attack.untrue import untrue
from tests.instrument.fuzzing import fuzz

SPOILT_A_TIME = 20
TRIAL = "trial"  # the folder of the attempts


def spoilt(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Recordings, motion records and settings with bytes and values at random, twenty an attempt."""
    rng = np.random.default_rng(random_.randrange(2**32))
    shot = Recording(
        "s", rng.integers(-2000, 2000, (2_000, 3)).astype(np.int16), 30e6,
        (Channel(Role.REFERENCE, 5e-4), Channel(Role.MEASUREMENT, 4e-4), Channel(Role.SWITCH, 1e-3)),
        Setup(0.01785, wavelength_air_m=632.8e-9, digitizer_bits=12, extra={"rig": "north"}),
        trigger_sample=500, gaps=(Gap(700, 3),), note="a note", started_at="2026-01-01T00:00:00Z",
    )  # fmt: skip
    number = 0
    while True:
        number += 1

        def attempt(number: int = number) -> str:
            place = folder / str(number)
            place.mkdir()
            fuzz(place, shot, SPOILT_A_TIME, random_.randrange(2**32))
            return SURVIVED

        yield f"{SPOILT_A_TIME} files", attempt


def nothing(folder: Path) -> None:
    """Load nothing."""


def kernels(folder: Path) -> None:
    """Load the kernels, by reading one sound recording."""
    assert analysed(simulate(folder, 1)[0]) == SURVIVED


def fits(folder: Path) -> None:
    """Load the kernels that a model is fitted with, too."""
    for settings in (AnalysisSettings(), AnalysisSettings(model="contact")):
        assert load_and_analyse(simulate(folder / settings.model, 1)[0], settings=settings).fit is not None


def live(folder: Path) -> None:
    """Load the kernels that a capture looks at its signals with."""
    warm()


@dataclass(frozen=True, slots=True)
class AttackKind:
    """An attack, the number of its attempts at length, and what runs before they are measured."""

    attack: Attack
    count: int
    warm: Callable[[Path], None] = nothing


KINDS = {
    "claims": AttackKind(claims, 400, kernels),
    "moving data": AttackKind(moving_data, 100, kernels),
    "spoilt": AttackKind(spoilt, 400),
    "texts": AttackKind(texts, 3000),
    "travelling": AttackKind(travelling, 100, kernels),
    "foreign": AttackKind(foreign, 1500),
    "scopes": AttackKind(scopes, 400, live),
    "usb": AttackKind(usb_devices, 80, live),
    "ni": AttackKind(ni_cards, 96, live),
    "clocks": AttackKind(clocks, 20, live),
    "folders": AttackKind(folders, 2, kernels),
    "sessions": AttackKind(sessions, 20),
    "kills": AttackKind(kills, 30),
    "outputs": AttackKind(outputs, 40, fits),
    "untrue": AttackKind(untrue, 150, kernels),
    "records": AttackKind(records, 300, fits),
    "models": AttackKind(models, 60, fits),
    "laws": AttackKind(laws, 40, fits),
    "planted": AttackKind(planted, 17, kernels),
    "journals": AttackKind(journals, 2000),
}


def attacked(name: str, folder: Path, count: int, seed: int) -> Outcome:
    """Make ``count`` attempts of the kind ``name`` and return what became of them."""
    kind = KINDS[name]
    kind.warm(folder / "warm")
    return carry_out(name, kind.attack, folder / TRIAL, count, seed, HANGS_S)
