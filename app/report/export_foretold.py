"""What a saved model foretold of shots that took no part in it, as CSV."""

from dataclasses import asdict
from pathlib import Path

from analysis.diagnosis.result import Errors
from analysis.diagnosis.verdict.foretold import Foretold
from app.report.export import write_table

KEYS = ("displacement_rms_m", "velocity_rms_m_per_s", "force_rms_n", "reduced_chi2")


def export_foretold(foretold: Foretold, folder: Path) -> Path:
    """Write ``foretold.csv``: a row a shot and one for all; an empty cell was not seen.  Raises OSError."""
    header = ["name", "took_part", "problem"]
    header += [f"{which}_{key}" for which in ("base", "model") for key in KEYS]
    rows = [
        [
            shot.name,
            str(shot.took_part).lower(),
            shot.problem or "",
            *_cells(shot.error_base),
            *_cells(shot.error_model),
        ]
        for shot in foretold.shots
    ]
    rows.append(["all", "", foretold.sentence, *_cells(foretold.error_base), *_cells(foretold.error_model)])
    write_table(header, rows, folder / "foretold.csv")
    return folder / "foretold.csv"


def _cells(errors: Errors | None) -> list[str]:
    if errors is None:
        return [""] * len(KEYS)
    values = asdict(errors)
    return ["" if values[key] != values[key] else repr(float(values[key])) for key in KEYS]
