"""What a page says while the work that fills it is under way, or waits behind other work."""

from app.session.jobs import Job, Jobs


def waits_for(jobs: Jobs, job: Job, what: str) -> str:
    """Return "computing ..." or which work comes first."""
    current = jobs.current
    if current is None or current is job:
        return f"computing {what} …"
    return f"waiting for {current.name} to end; then {what} will be computed"
