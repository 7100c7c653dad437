"""Print the lowest versions that pyproject.toml allows, as pip takes them: ``name==version``, one a line."""

import re
import tomllib
from pathlib import Path

_NEEDED_FOR_TESTS = ("test",)


def main() -> None:
    """Print them."""
    with (Path(__file__).resolve().parents[1] / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    wanted = [*project["dependencies"]]
    for extra in _NEEDED_FOR_TESTS:
        wanted += project["optional-dependencies"][extra]
    for requirement in wanted:
        found = re.match(r"([\w.-]+)\s*>=([\d.]+)", requirement)
        if found and ";" not in requirement:  # what other systems need is not for this one
            print(f"{found[1]}=={found[2]}")


if __name__ == "__main__":
    main()
