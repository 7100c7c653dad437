"""False knocks: ``python -m tests.benchmarks.knocks [--shots N] [--seed S]``.

N shots a site on the program's own bench and on the independent rig (``tests.building_rig``), none of which was struck:
how many readings say ``knock``, and how many could not be read.
"""

import argparse
import subprocess
from collections.abc import Callable, Iterator

from analysis.compiled.kernel_cache import use_kernel_cache
from analysis.reading.read import NoImpact, read_impact
from analysis.shot.motion import Motion
from tests.bench.blind import records
from tests.benchmarks.buildings import SITES, clean_rig
from tests.benchmarks.loop_cases import as_motion
from tests.benchmarks.loop_score import Share
from tests.benchmarks.site_cases import Case, draw


def own_bench(site: str, seed: int) -> list[Motion]:
    """Return a clean set of the program's own bench."""
    truth, _ = draw(Case(site, "", seed))
    return [as_motion(record) for record in records(truth)]


def independent_rig(site: str, seed: int) -> list[Motion]:
    """Return a clean set of the independent rig."""
    return clean_rig(site, seed).shots(seed)


def flags(rig: Callable[[str, int], list[Motion]], site: str, seed: int, shots: int) -> Iterator[tuple[str, ...]]:
    """Yield the flags of so many readings; ("not read",) where there is none."""
    while shots > 0:
        for motion in rig(site, seed)[:shots]:
            shots -= 1
            try:
                yield read_impact(motion).flags
            except NoImpact:
                yield ("not read",)
        seed += 1


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark and print how many readings of every site say that it was struck."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shots", type=int, default=48, metavar="N", help="a site and rig")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    use_kernel_cache()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    print(f"seed {options.seed} at {commit.stdout.strip()}, clean shots in buildings")
    for rig in (own_bench, independent_rig):
        knocked = unread = shots = 0
        for number, site in enumerate(SITES):
            told = list(flags(rig, site, options.seed * 1_000_003 + 10_000 * number, options.shots))
            here = sum("knock" in of for of in told)
            unread += sum(of == ("not read",) for of in told)
            knocked, shots = knocked + here, shots + len(told)
            print(f"  {rig.__name__}, {site}: knock {Share(here, len(told))}", flush=True)
        print(f"{rig.__name__}: knock {Share(knocked, shots)}, not read {unread}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
