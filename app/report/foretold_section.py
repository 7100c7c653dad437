"""What a saved model foretold of the report's shots, beside its base alone."""

from analysis.diagnosis.result import Errors
from analysis.diagnosis.verdict.foretold import Foretold
from app.report.diagnosis_section import error_rows
from app.report.markup import Markup, joined, table, tag
from app.words.physics_words import effect_words


def foretold_section(foretold: Foretold) -> Markup:
    """Return the section: the sentence, the errors of all shots, and those of each."""
    effects = " + ".join(effect_words(name) for name in foretold.effects) or "no effect"
    columns: list[tuple[str, Errors]] = [("base alone", foretold.error_base), ("whole model", foretold.error_model)]
    shots = []
    for shot in foretold.shots:
        remark = shot.problem or ("took part in the model\u2019s fit: no test" if shot.took_part else "")
        rows = error_rows([("", e) for e in (shot.error_base, shot.error_model) if e is not None])
        shots.append([shot.name, *(rows[0][1:] if rows else ["\u2013", "\u2013"]), remark])
    which = error_rows(columns)[0][0]
    said = (
        f"Model {foretold.model} with {effects}, as it was saved; only what is a shot\u2019s own (its speed, touch and "
        "offset; a drive\u2019s constant force) was fitted."
    )
    body = joined(
        tag("p", tag("b", f"{foretold.sentence[0].upper()}{foretold.sentence[1:]}.")),
        tag("p", said),
        table(["", *(name for name, _ in columns)], error_rows(columns), "numbers"),
        table(["shot", f"base alone: {which}", "whole model", "remarks"], shots, "numbers"),
    )
    return tag("section", tag("h2", "Test of model predictions"), body)
