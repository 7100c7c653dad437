"""``levimass acquire N --resolve M``: take N shots, diagnose them, take up to M more that decide the diagnosis."""

from collections.abc import Sequence
from pathlib import Path

from analysis.diagnosis import Diagnosis, diagnose
from analysis.planning import (
    NextShot,
    PlannedStep,
    PlanningState,
    Reach,
    next_step,
    plan_next,
)
from analysis.report import result
from analysis.shot import AnalysisError, Shot, fitted_shots
from app.command_line.acquire import CaptureRequest, opened, record_shots
from app.command_line.outputs import check_outputs, error_line, json_text, say, say_problem, write_json
from app.session import load_and_analyse, planned_record, planned_setup
from instrument.capture import AcquireError, acquire
from instrument.devices import DigitizerError, is_bench, with_push
from instrument.files import RecordingError


def resolve(first: int, most: int, request: CaptureRequest, json_to: str | None, reach: Reach | None = None) -> int:
    """Take ``first`` shots, then at most ``most`` planned ones within ``reach``; return the exit status.

    On the simulated bench the program sets speed and weights itself; for any other source it prints what to set and
    waits for the light switch.
    """
    try:
        check_outputs(json_to, None)
        shots = _analysed(record_shots(first, request))
        diagnosis, standing = _standing(shots, (), most, reach)
        for number in range(most):
            if standing.settled:
                break
            step = next_step(standing)
            shots += _analysed([_planned(step.shot, shots, request, number + first)])
            diagnosis, standing = _standing(shots, (*standing.steps, step), most - number - 1, reach)
    except (AcquireError, DigitizerError, RecordingError, AnalysisError) as error:
        say(error)
        return 1
    except OSError as error:
        say(error_line(error, request.out))
        return 1
    if json_to != "-":
        for shot in shots:
            print(shot.path)
        print(f"diagnosis: {diagnosis.verdict.value}: {diagnosis.sentence}")
    return _write(shots, diagnosis, standing, json_to)


def _planned(shot: NextShot, shots: Sequence[Shot], request: CaptureRequest, number: int) -> Path:
    """Take one planned shot: set speed and weights of the simulated bench, or print what to set at another source."""
    source = None
    if is_bench(request.source):
        source = with_push(request.source, shot.speed_m_per_s, shot.added_mass_kg, number)
    say(f"{'taking' if source else 'set the rig, then push the block:'} {shot.words}")
    digitizer = opened(source or request.source, request)
    setup = None if source else planned_setup(digitizer.setup, shot, shots)
    settings = planned_record(shot, shots, request.rate_hz)
    (path,) = acquire(digitizer, request.out, 1, settings, request.timeout_s, report=say, setup=setup)
    return path


def _analysed(paths: Sequence[Path]) -> list[Shot]:
    shots = [load_and_analyse(path) for path in paths]
    for shot in shots:
        say_problem(shot)
    return shots


def _standing(
    shots: Sequence[Shot], steps: Sequence[PlannedStep], left: int, reach: Reach | None
) -> tuple[Diagnosis, PlanningState]:
    fitted = fitted_shots(shots)
    if not fitted:
        raise AnalysisError("no shot could be analysed, so there is nothing to diagnose")
    diagnosis = diagnose(fitted)
    say(f"after {len(fitted)} shots: {diagnosis.sentence}")
    standing = plan_next(fitted, diagnosis, steps, left=left, reach=reach)
    if standing.steps:
        last = standing.steps[-1]
        reached = "not known" if last.reached is None else f"{last.reached:.2g}"
        say(f"expected separation {last.expected_separation:.2g} noise norms, reached {reached}")
    if standing.plan is not None:
        say(standing.plan.words)
    return diagnosis, standing


def _write(shots: Sequence[Shot], diagnosis: Diagnosis, standing: PlanningState, json_to: str | None) -> int:
    if json_to is None:
        return 0
    further = None if standing.plan is None else standing.plan.to_json()
    steps = [step.to_json() for step in standing.steps]
    whole = result(shots, diagnosis) | {"plan": steps, "next_shots": further}
    try:
        write_json(json_text(whole), json_to)
    except RecordingError as error:
        say(error)
        return 1
    return 0
