"""About: the program, what it runs on, and under which licences, as text that can be copied."""

from email.message import Message
from importlib.metadata import PackageNotFoundError, metadata
from typing import cast

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPlainTextEdit, QWidget

from app.report.provenance import program_words
from app.window.panels.side_sheet import SideSheet

PARTS = (
    "numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "shiboken6", "pyqtgraph", "pyusb", "platformdirs",
    "uncertainties", "h5py", "npTDMS", "niscope", "distributed",
)  # fmt: skip


def licence_words() -> str:
    """Return program and parts with version and licence, a line each; what is not installed is left out."""
    lines = [program_words(), "Licence: MIT", "", "It stands on:"]
    for name in PARTS:
        try:
            known = cast(Message, metadata(name))  # as importlib's own types leave out most of it
        except PackageNotFoundError:
            continue
        licence = known.get("License-Expression") or known.get("License") or ""
        if not licence or len(licence) > 80:  # some put the whole text there
            told = [line.split(" :: ")[-1] for line in known.get_all("Classifier") or [] if line.startswith("License")]
            licence = ", ".join(told) or "see the package"
        lines.append(f"{name} {known['Version']}: {licence}")
    return "\n".join(lines)


class AboutSheet(SideSheet):
    """Hidden until it is asked for; its words are made then."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("About", parent)
        column, self._close = self.head("About Levimass", "Close this sheet  (Esc)")
        self.words = QPlainTextEdit(self)
        self.words.setReadOnly(True)
        self.words.setTabChangesFocus(True)
        self.words.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self.words.setAccessibleName("Versions and licences")
        column.addWidget(self.words, 1)

    def open(self) -> None:
        """Show the sheet."""
        if not self.words.toPlainText():
            self.words.setPlainText(licence_words())
        self.open_at(self._close)
