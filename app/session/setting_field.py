"""What a setting is on the screen: its key, words, unit and limits."""

from dataclasses import dataclass

Value = float | str | bool | None


@dataclass(frozen=True, slots=True)
class Field:
    """One setting: its key, where it stands, its words; ``scale`` turns the stored value into the shown one."""

    key: str
    group: str
    words: str
    kind: str  # "number" | "numbers" (SI, parted by blanks) | "choice" | "folder" | "flag"
    unit: str = ""
    scale: float = 1.0
    low: float = float("-inf")
    high: float = float("inf")
    hover: str = ""
    choices: tuple[tuple[str, str], ...] = ()  # (stored, words)
    optional: bool = False  # an empty field means: not given
