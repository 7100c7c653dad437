"""Motion records, models and laws with numbers that no rig has: through the reading and the fit, watched for time."""

import random
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.collision.laws.user_law import LawError, known_effect, law_from_table
from analysis.collision.parameters import PAPER
from analysis.collision.solver import general
from analysis.diagnosis.evidence.prediction_errors import evaluate_predictions
from analysis.diagnosis.findings.model_file import from_text
from analysis.diagnosis.findings.wording import prediction_words
from analysis.fitted.fit_time import run_with_time_limit
from analysis.inference.model.free_parameters import trial_effects
from analysis.shot.shot import AnalysisError, AnalysisSettings
from app.session.load import load_and_analyse
from tests.analysis.shots import shots_of
from tests.analysis.synthetic_collision import Synthetic, motion_of, position_m
from tests.attack.trial import REFUSED, SURVIVED, Attempt, refused_in_a_line

BOUNDED = AnalysisSettings(fit_seconds=2.0)
UNITS = (*[1.0] * 20, 1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9, 60.0)
_SPOILT = (
    "step", "spikes", "constant", "noise", "sine", "holes", "turned", "far away", "small", "counted", "pushed on",
    "cut", "late in the day", "uneven", "jumbled", "no numbers",
)  # fmt: skip
_TAKEN = (
    "far away", "small", "counted", "pushed on", "holes", "late in the day", "jolt", "sways", "wanders", "outliers",
)  # fmt: skip
VALUES = (0.0, -205.0, 1e300, 1e-300, 1e15, 1e-15, float("nan"), float("inf"), 221.4, 1e3, 5e6, 1e-3, -1.0, 1e9)


def records(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Collisions in other units, of other masses, other noise, other lengths; steps, spikes, holes, plain nonsense.

    Every other one is such that the reading mostly takes it, so that it comes to the fit.
    """
    while True:
        yield _record(folder / "record", random_, wild=True)
        yield _record(folder / "record", random_, wild=False)


def _record(stem: Path, random_: random.Random, *, wild: bool) -> Attempt:
    rate = 10 ** random_.uniform(2.5 if wild else 3.7, 5.0)
    durations_s = (0.06, 0.045, 0.3) if wild else (0.06, 0.05)
    drag = random_.choice((0.0, 0.0, 0.1))
    rig = Synthetic(random_.choice((0.265, 0.1, 0.02)), duration_s=random_.choice(durations_s), drag_n_s_per_m=drag)
    time = np.arange(0.0, rig.duration_s, 1.0 / rate)[: 20_000 if wild else 3_000]
    noise = np.random.default_rng(random_.randrange(2**32))
    x = position_m(rig, time) + noise.normal(0.0, 10 ** random_.uniform(-12, -3 if wild else -7), time.size)
    kind = random_.choice(("as it is", "as it is", *(_SPOILT if wild else _TAKEN)))
    middle = time.size // 2
    if kind == "step":
        x[middle:] += random_.choice((1e-6, 1.0, -1e6))
    elif kind == "spikes":
        x[:: max(2, time.size // 7)] += 1e3
    elif kind == "constant":
        x[:] = 1.0
    elif kind == "noise":
        x = noise.normal(0.0, 1.0, time.size)
    elif kind == "sine":
        x = np.sin(2 * np.pi * random_.uniform(1, 2000) * time)
    elif kind == "turned":
        x = -x
    elif kind == "far away":
        x += 10 ** random_.uniform(0, 12)
    elif kind == "small":
        x *= 10 ** random_.uniform(-9, -1)
    elif kind == "counted":
        step = 10 ** random_.uniform(-9, -3)
        x = step * np.rint(x / step)
    elif kind == "pushed on":
        x += random_.choice((-1.0, 1.0)) * 10 ** random_.uniform(-3, 3) * (time - time[middle]) ** 2
    elif kind == "cut":
        first = random_.randrange(time.size - 2)
        part = slice(first, random_.randrange(first + 1, time.size + 1))
        time, x = time[part], x[part]
    elif kind == "late in the day":
        time = time + 10 ** random_.uniform(2, 9)
    elif kind == "uneven":
        time = time + noise.uniform(-0.45, 0.45, time.size) / rate
    elif kind == "jumbled":
        noise.shuffle(time)
    elif kind == "no numbers":
        x[noise.integers(0, time.size, 5)] = random_.choice((np.nan, np.inf, -np.inf, 1e300, 5e-324))
    elif kind == "jolt":
        x[middle:] += random_.choice((-1.0, 1.0)) * 10 ** random_.uniform(-9, -5)
    elif kind == "sways":
        x += 10 ** random_.uniform(-9, -4) * np.sin(2.0 * np.pi * 10 ** random_.uniform(0, 3.3) * time)
    elif kind == "wanders":
        x += 10 ** random_.uniform(-11, -7) * np.cumsum(noise.normal(0.0, 1.0, time.size))
    elif kind == "outliers":
        x[noise.integers(0, time.size, 3)] += random_.choice((-1.0, 1.0)) * 10 ** random_.uniform(-8, -4)
    unit_s, unit_m = random_.choice(UNITS) if wild else 1.0, random_.choice(UNITS)
    keep = noise.uniform(size=time.size) > 0.3 if kind == "holes" else np.ones(time.size, dtype=np.bool_)
    mass = random_.choice((*[0.01785] * 6, 1e-9, 1e6, 1.0, 1e-3))
    model = random_.choice(("plate", "plate", "contact", "driven") if wild else ("plate", "plate", "contact"))
    base = random_.choice((None, None, None, "clamped", "no_tension")) if model == "plate" else None
    effects = tuple(random_.sample([kind.effect for kind in trial_effects()], random_.choice((0, 0, 1, 2))))
    settings = replace(BOUNDED, effects=effects if model == "plate" else ())
    force = noise.normal(0.0, 1.0, time.size)

    def attempt() -> str:
        columns = [time[keep] / unit_s, x[keep] / unit_m, *([force[keep]] if model == "driven" else [])]
        header = "time_s,displacement_m" + (",force_n" if model == "driven" else "")
        table = stem.with_suffix(".csv")
        np.savetxt(table, np.stack(columns, axis=1), delimiter=",", header=header, comments="", fmt="%.17g")
        stem.with_suffix(".toml").write_text(f'model = "{model}"\nmoving_mass_kg = {mass!r}\n')
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            shot = load_and_analyse(table, base, settings=settings)
        assert not said, f"{said[0].filename}:{said[0].lineno}: {said[0].message}"
        if shot.fit_problem is not None:
            refused_in_a_line(shot.fit_problem)
            assert "Collision(" not in shot.fit_problem, shot.fit_problem
        return SURVIVED if shot.problem is None else refused_in_a_line(shot.problem)

    what = " + ".join((base or model, *(effect.name for effect in settings.effects)))
    return f"{what}, {kind}, {time.size} rows, time in {unit_s:g} s, place in {unit_m:g} m, {mass:g} kg", attempt


def models(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Model files with values that no rig has, put to the test on a sound shot."""
    motion = motion_of(Synthetic())
    names = ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m")
    while True:
        values = dict(zip(names, (221.4, 1.984e-4, 1e4, 0.4), strict=True))
        for name in random_.sample(names, random_.choice((1, 1, 2))):
            values[name] = random_.choice(VALUES)
        std = random_.choice((1e-3, 1e-3, 1e-3, *VALUES))
        if random_.random() < 0.2:
            del values[random_.choice(names)]
        lines = [f"{name} = {{ value = {value!r}, std = {std!r} }}\n" for name, value in values.items()]
        base = random_.choice(("paper", "paper", "paper", "contact", "clamped", "no_tension"))
        rows = np.diag([random_.choice((0.0, 0.0, 1e-6, *VALUES))] * len(values))
        rows[0, -1] = rows[-1, 0] = random_.choice((0.0, 0.0, 1e-9, *VALUES))
        head = f'schema = "levimass.model/1"\nbase = "{base}"\neffects = []\n[parameters]\n'
        text = head + "".join(lines) + random_.choice(("", f"[covariance]\nrows = {rows.tolist()}\n"))

        def attempt(text: str = text) -> str:
            try:
                known = from_text(text)
                predicted = run_with_time_limit(lambda: evaluate_predictions(shots_of([motion]), known), 3.0)
            except AnalysisError as error:
                return refused_in_a_line(str(error))
            said = prediction_words(predicted)
            assert "inf%" not in said and "-0%" not in said
            return SURVIVED

        yield (
            f"{base}, {', '.join(f'{value:g}' for value in values.values())}, std {std:g}, {rows[0].tolist()}",
            attempt,
        )


def laws(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Formulas put together at random, with divisions by what passes through zero: read, written, followed."""
    leaves = ("x", "v", "y", "u", "d", "d_rate", "t", "a", "0", "1e3", "1e-9")
    times = np.arange(-200, 3001, 20) * 1e-5

    def made(depth: int) -> str:
        if depth == 0 or random_.random() < 0.2:
            return random_.choice(leaves)
        kind = random_.randrange(4)
        if kind == 0:
            return f"{random_.choice(('abs', 'sign', 'log', 'exp', 'sqrt', 'tanh', 'step'))}({made(depth - 1)})"
        if kind == 1:
            return f"({made(depth - 1)})**{random_.choice(('2', '3', '-1', '0.5', '-2'))}"
        return f"({made(depth - 1)} {random_.choice('+-*//')} {made(depth - 1)})"

    while True:
        name = random_.choice(("mine", "stir_", "_stir", "a__b"))
        start = 10 ** random_.uniform(*random_.choice(((-9.0, 2.0), (-9.0, 2.0), (-300.0, 300.0))))
        table: dict[str, Any] = {"name": name, "where": random_.choice(("block", "plate", "contact"))}
        table |= {"formula": f"-a*{made(2)}", "parameters": {"a": {"unit": "", "start": start}}}

        def attempt(table: dict[str, Any] = table) -> str:
            try:
                law = law_from_table(table)
            except LawError as error:
                return refused_in_a_line(str(error))
            assert known_effect(law.key) == law, "does not survive its own file"
            try:
                active = general.ActiveEffect(law, (law.parameters[0].tried[0],))
                general.solve(PAPER, [active], times, directions=[0, 2])
            except ArithmeticError as error:  # no trajectory: a search turns back there
                assert "division" not in str(error), error
                return REFUSED
            return SURVIVED

        yield f"{table['where']}: {table['formula']}", attempt
