"""About: versions and licences of the program and its packages, as text that can be copied."""

from email.message import Message
from importlib.metadata import PackageNotFoundError, metadata
from typing import cast

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPlainTextEdit, QWidget

from app.report import program_words
from app.window.panels.side_sheet import SideSheet

PARTS = (
    "numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "shiboken6", "pyqtgraph", "pyusb", "platformdirs",
    "uncertainties", "threadpoolctl", "lazy_loader", "h5py", "npTDMS", "niscope", "distributed",
)  # fmt: skip


def licence_words() -> str:
    """Return program and installed packages with version and licence, a line each."""
    lines = [program_words(), "Licence: MIT", "", "It uses:"]
    for name in PARTS:
        try:
            known = cast(Message, metadata(name))  # importlib's type lacks most of its methods
        except PackageNotFoundError:
            continue
        licence = known.get("License-Expression") or known.get("License") or ""
        if not licence or len(licence) > 80:  # some put the whole text there
            classifiers = [line for line in known.get_all("Classifier") or [] if line.startswith("License")]
            licence = ", ".join(line.split(" :: ")[-1] for line in classifiers) or "see the package"
        lines.append(f"{name} {known['Version']}: {licence}")
    return "\n".join(lines)


class AboutSheet(SideSheet):
    """The sheet; its text is made when it first opens."""

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
