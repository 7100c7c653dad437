"""Non-modal file dialogs, so that a shot can be taken while one is open."""

from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget


class PathKind(Enum):
    """The kind of path that a dialog selects."""

    FILE = QFileDialog.FileMode.ExistingFile
    FILES = QFileDialog.FileMode.ExistingFiles
    FOLDER = QFileDialog.FileMode.Directory
    NEW_FILE = QFileDialog.FileMode.AnyFile


def ask(
    parent: QWidget, title: str, want: PathKind, then: Callable[[Any], object], start: Path | str, kinds: str = ""
) -> QFileDialog:
    """Open a file dialog and return at once; ``then`` is called with the path, or for FILES the list, unless cancelled.

    ``kinds`` are Qt's filters, such as "HTML (*.html);;All files (*)"; a new file gets the ending of the first.  If
    a dialog with this title is already open, it is raised instead.
    """
    for dialog in parent.findChildren(QFileDialog):
        if dialog.windowTitle() == title and dialog.isVisible():
            dialog.raise_()
            dialog.activateWindow()
            return dialog
    dialog = QFileDialog(parent, title)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setModal(False)
    dialog.setFileMode(want.value)
    if want is PathKind.FOLDER:
        dialog.setOption(QFileDialog.Option.ShowDirsOnly)
    if want is PathKind.NEW_FILE:
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        first = kinds.partition(";;")[0]
        dialog.setDefaultSuffix(first.partition("*.")[2].rstrip(")").partition(" ")[0])
    if kinds:
        dialog.setNameFilters(kinds.split(";;"))
    place = Path(start)
    if want is not PathKind.NEW_FILE:
        dialog.setDirectory(str(place))
    elif start:
        dialog.setDirectory(str(place.parent))
        dialog.selectFile(place.name)
    dialog.filesSelected.connect(partial(_hand_on, then, want))
    dialog.show()
    return dialog


def _hand_on(then: Callable[[Any], object], want: PathKind, names: Sequence[str]) -> None:
    paths = [Path(name) for name in names]
    then(paths if want is PathKind.FILES else paths[0])


class FileDialogs:
    """Opens dialogs in the folder chosen last, or at first in the folder that ``start`` returns."""

    def __init__(self, parent: QWidget, start: Callable[[], Path]) -> None:
        self._parent, self._start = parent, start
        self.chosen: Path | None = None

    @property
    def folder(self) -> Path:
        """Get the folder that the next dialog shows first."""
        return self.chosen or self._start()

    def ask(self, title: str, want: PathKind, then: Callable[[Path], object], name: str = "", kinds: str = "") -> None:
        """Open a dialog for one file or folder; ``then`` is called with it; ``name`` is proposed for a new file."""

        def chosen(path: Path) -> None:
            self.chosen = path if want is PathKind.FOLDER else path.parent
            then(path)

        ask(self._parent, title, want, chosen, self.folder / name, kinds)
