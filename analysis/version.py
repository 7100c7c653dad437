"""Which program this is."""

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """Return the installed version of the program, or "unknown" when run from an uninstalled tree."""
    try:
        return version("levimass")
    except PackageNotFoundError:
        return "unknown"
