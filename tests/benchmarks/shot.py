"""Measure a shot's numbers and the diagnosis of three against scipy's analytic signal of the same counts.

``python -m tests.benchmarks.shot``.  5 M samples a channel of the simulated bench, 30 MS/s; every round takes all in
turns, the best of the rounds is printed, and what is compared are ratios within the run.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from analysis.compiled.kernel_cache import use_kernel_cache

ROUNDS = 5
SAMPLES, RATE_HZ = 5_000_000, 30e6
STEPS = ("load", "demodulate", "impact", "fit")


def main() -> int:
    """Print what each step takes over what the analytic signal of both channels takes; return 1 where one is missed."""
    use_kernel_cache()
    from app.session.load import load_and_analyse
    from instrument.bench.simulated_shots import simulate
    from instrument.files.recording_file import open_recording
    from tests.benchmarks.peers import analytic_signal

    best = dict.fromkeys((*STEPS, "all", "hilbert", "hashed", "unhashed", "call", "call unchecked"), float("inf"))
    with tempfile.TemporaryDirectory() as folder:
        (path,) = simulate(Path(folder), 1, sample_rate_hz=RATE_HZ, duration_s=SAMPLES / RATE_HZ)
        counts = open_recording(path).counts
        for _ in range(ROUNDS):
            began = time.perf_counter()
            shot = load_and_analyse(path)
            whole_s = time.perf_counter() - began
            if shot.fit is None or not shot.fit.converged:
                print(f"the bench's own shot was not fitted: {shot.problem or shot.flags}", file=sys.stderr)
                return 1
            for way, seconds in (("hashed", whole_s), ("unhashed", _unhashed_s(path))):
                best[way] = min(best[way], seconds)
            for way, more in (("call", ()), ("call unchecked", ("--unchecked",))):
                best[way] = min(best[way], _call_s(path, *more))
            for step in STEPS:
                best[step] = min(best[step], shot.seconds[step])
            best["all"] = min(best["all"], sum(shot.seconds.values()))
            began = time.perf_counter()
            for channel in (0, 1):
                analytic_signal(counts[:, channel], RATE_HZ)
            best["hilbert"] = min(best["hilbert"], time.perf_counter() - began)
    for step in (*STEPS, "all"):
        print(f"  {step:<12} {1e3 * best[step]:9.1f} ms   {best[step] / best['hilbert']:8.4f} of hilbert, two channels")
    share = best["all"] / best["hilbert"]
    print(f"  whole shot over hilbert {share:.3f} (target <= 0.125) {'ok' if share <= 0.125 else 'MISSED'}")
    share = best["hashed"] / best["unhashed"] - 1.0
    print(f"  the data's hash beside a shot, all loaded {100 * share:+.1f} % (a campaign's; --unchecked leaves it out)")
    share = best["call"] / best["call unchecked"] - 1.0
    print(f"  and of a call of --replay {100 * share:+.1f} % (target < 10 %) {'ok' if share < 0.1 else 'MISSED'}")
    return _diagnosis(best["hilbert"])


def _call_s(path: Path, *more: str) -> float:
    """Return how long a whole call takes, from start to exit."""
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "app", "--replay", str(path), "--no-diagnose", *more],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - began


def _unhashed_s(path: Path) -> float:
    """Return how long the same shot takes where nobody asks whether its data have their hash."""
    from app.session.load import load_and_analyse

    began = time.perf_counter()
    load_and_analyse(path, checked=False)
    return time.perf_counter() - began


def _diagnosis(hilbert_s: float) -> int:
    from analysis.diagnosis.diagnosis_of_shots import diagnose
    from analysis.pipeline import analyse_motion
    from analysis.shot.shot import AnalysisSettings
    from tests.analysis.diagnosis.shots import shots

    cases = {
        "one effect": ({"coulomb_friction": {"force_n": 2e-6}}, 0.8),
        "unexplained": ({"magnet": {"force_n": -3e-3, "range_m": 7e-4}}, 3.0),
    }
    for name, (effects, target_s) in cases.items():
        read = [analyse_motion(motion, AnalysisSettings(), name="") for motion in shots(effects)]
        took = []
        for _ in range(3):
            began = time.perf_counter()
            verdict = diagnose(read).verdict
            took.append(time.perf_counter() - began)
        print(
            f"  diagnosis of three read shots, {name} ({verdict.value}): {sorted(took)[1]:.2f} s, "
            f"{sorted(took)[1] / hilbert_s:.2f} of hilbert (target on calm cores {target_s:g} s)"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
