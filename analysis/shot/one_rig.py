"""Whether shots may be judged together: of one base model; their masses and plates may differ."""

from collections.abc import Sequence

from analysis.shot.shot import Shot


def why_not_together(shots: Sequence[Shot]) -> str | None:
    """Return why these shots cannot be fitted or diagnosed together, in words; None where they can."""
    models = sorted({shot.settings.model for shot in shots})
    if len(models) > 1:
        return f"the shots use different base models ({', '.join(models)}): select shots of one"
    return None
