"""The wheel: the four folders of the repository as parts of one package, so that it claims one name only.

In the repository they are imported by their own names.  Another program's ``analysis`` or a ``resources`` in the
working folder would be taken for ours if the wheel did so too; there each import is written with ``levimass.`` before
it.  What cannot be told by its text stops the build.
"""

import ast
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PARTS = ("app", "instrument", "analysis", "resources")
_ONE_OF = "|".join(PARTS)
_IMPORT = re.compile(rf"^(\s*(?:from|import)\s+)({_ONE_OF})\b", re.MULTILINE)
_BY_NAME = re.compile(rf'(\b(?:files|_imported)\(")({_ONE_OF})\b')
_A_MODULE = re.compile(r"(?:resources|(?:app|instrument|analysis)(?:\.[a-z_0-9]+)+(?::\w+)?)\Z")


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Gives the wheel its sources; an editable installation uses those of the repository as they are."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the package into a folder beside and hand it to the builder."""
        if version == "editable":
            return
        self._made = Path(tempfile.mkdtemp(prefix="levimass-wheel-"))
        write_package(Path(self.root), self._made)
        build_data["force_include"][str(self._made)] = "levimass"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove that folder."""
        if version != "editable":
            shutil.rmtree(self._made, ignore_errors=True)


def write_package(repository: Path, package: Path) -> None:
    """Write the package ``levimass`` as the wheel holds it.  Raises ValueError on an import it cannot name."""
    folders = {repository / "levimass": package, **{repository / part: package / part for part in PARTS}}
    for source, target in folders.items():
        for path in sorted(source.rglob("*")):
            if path.is_dir() or "__pycache__" in path.parts or path.suffix in (".pyc", ".nbi", ".nbc"):
                continue
            written = target / path.relative_to(source)
            written.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix == ".py":
                written.write_text(renamed(path.read_text(encoding="utf-8"), str(path)), encoding="utf-8")
            else:
                shutil.copyfile(path, written)


def renamed(text: str, where: str) -> str:
    """Return a source whose imports of the parts name the package.  Raises ValueError where one is left over."""
    text = _BY_NAME.sub(r"\1levimass.\2", _IMPORT.sub(r"\1levimass.\2", text))
    for node in ast.walk(ast.parse(text)):
        left: list[str] = []
        if isinstance(node, ast.Import):
            left = [alias.name for alias in node.names if alias.name.split(".")[0] in PARTS]
            left += [alias.name for alias in node.names if alias.name.startswith("levimass.") and not alias.asname]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            left = [node.module] if node.module and node.module.split(".")[0] in PARTS else []
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _A_MODULE.match(node.value):
            left = [repr(node.value)]
        if left:
            raise ValueError(f"{where}, line {node.lineno}: {', '.join(left)} has no name in the wheel")
    return text
