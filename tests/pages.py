"""The pages of docs/: their blocks of code, and the parts that ``make screen`` writes from the code."""

import os
import re
from pathlib import Path
from typing import Any

from analysis.collision.effects import on_block
from analysis.collision.effects.row import Effect

DOCS = Path(__file__).resolve().parents[1] / "docs"


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def code_blocks(name: str, language: str = "python") -> list[str]:
    """Return the page's blocks of code in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page(name), re.DOTALL | re.MULTILINE)


def check_part(name: str, kept: str, now: str) -> None:
    """Compare a part of a page with what the code makes of it; or write it (``make screen``)."""
    if os.environ.get("LEVIMASS_WRITE_SCREEN"):
        (DOCS / name).write_text(page(name).replace(kept, now), encoding="utf-8")
    else:
        assert kept.splitlines() == now.splitlines(), "after an intended change: make screen"


def effect_of_the_page() -> Effect:
    """Return the effect of add-an-effect.md: its function and its row, as they would stand in ``on_block.py``."""
    function, row = code_blocks("add-an-effect.md")[:2]
    names = vars(on_block) | {"Any": Any}
    exec(compile(function, "on_block.py", "exec"), names)
    effect = eval(row, names)
    assert isinstance(effect, Effect)
    return effect
