"""``make bench``: every benchmark that ends within minutes, one after the other; those that run long have targets of
their own (bench-loop, bench-sites, bench-soak, bench-streaming)."""

import importlib.util
import subprocess
import sys

QUICK = (
    "demodulation",
    "simulation",
    "solver",
    "shot",
    "fit_coverage",
    "screen",
    "campaign",
    "coverage",
    "first_start",
)


def main() -> int:
    """Run the benchmarks in processes of their own; return 1 when one of them broke down."""
    worst = 0
    for name in QUICK:
        module = f"tests.benchmarks.{name}"
        if importlib.util.find_spec(module) is None:
            continue
        print(f"\n== {name} (python -m {module})", flush=True)
        worst = max(worst, subprocess.run([sys.executable, "-m", module], check=False).returncode)
    return 1 if worst else 0


if __name__ == "__main__":
    raise SystemExit(main())
