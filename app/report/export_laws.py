"""The curves of learned laws, as CSV for other programs."""

from pathlib import Path

from analysis.diagnosis.result import Diagnosis, LearnedLaw
from app.report.export import write_table


def export_laws(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write ``law_1.csv`` and so on, a row a point of the learned curve; return the paths.  Raises OSError."""
    paths = []
    for number, law in enumerate(diagnosis.laws, 1):
        columns = law_columns(law)
        rows = [[repr(float(value)) for value in row] for row in zip(*columns.values(), strict=True)]
        path = folder / f"law_{number}.csv"
        write_table(list(columns), rows, path)
        paths.append(path)
    return paths


def law_columns(law: LearnedLaw) -> dict[str, list[float]]:
    """Return the columns of a law's curve by their names: the argument, the free curve, its band, the closed forms."""
    unit = law.curve_unit.replace("/", "_per_")
    columns = {f"{law.argument.replace(' ', '_')}_{unit}": law.curve_argument.tolist()}
    columns |= {"force_n": law.curve_force_n.tolist(), "force_std_n": law.curve_std_n.tolist()}
    forms = [(law.nearest_form, law.form_force_n)]
    forms += [(other.form, other.curve_force_n) for other in law.other_forms if other.curve_force_n is not None]
    for form, curve in forms:
        assert curve is not None
        columns[f"{form.replace(', ', '_').replace(' ', '_')}_n"] = curve.tolist()
    return columns
