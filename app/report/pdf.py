"""The report as pages: its HTML laid out by Qt, its figures drawn from their SVG."""

import os
import re
from pathlib import Path

from PySide6.QtCore import QByteArray, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QGuiApplication, QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer

from instrument.recording_writer import write_beside

_FIGURE = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_WIDTH = 680  # of a figure on the page, in the document's pixels
_FINER = 3.0  # than that a figure is drawn
_MARGIN_MM = 15.0


def document_of(html: str) -> QTextDocument:
    """Return the report as a document that prints; every inline figure becomes a picture of it."""
    document = QTextDocument()

    def pictured(found: re.Match[str]) -> str:
        name = f"figure:{found.start()}"
        image = _drawn(found[0])
        document.addResource(QTextDocument.ResourceType.ImageResource.value, QUrl(name), image)
        return f'<img src="{name}" width="{_WIDTH}" height="{round(_WIDTH * image.height() / max(1, image.width()))}">'

    document.setHtml(_FIGURE.sub(pictured, html))
    return document


def write_pdf(html: str, path: Path) -> None:
    """Write the report as a PDF of A4 pages.  Raises RecordingError."""
    application = QGuiApplication.instance()
    if application is None:  # in a process without a screen; fonts need one all the same
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        application = QGuiApplication([])
    beside = path.with_name(f".levimass-report.{os.getpid()}.new")
    try:
        writer = QPdfWriter(str(beside))
        margins = QMarginsF(_MARGIN_MM, _MARGIN_MM, _MARGIN_MM, _MARGIN_MM)
        writer.setPageLayout(
            QPageLayout(
                QPageSize(QPageSize.PageSizeId.A4),
                QPageLayout.Orientation.Portrait,
                margins,
                QPageLayout.Unit.Millimeter,
            )
        )
        writer.setResolution(96)
        document = document_of(html)
        document.setPageSize(QSizeF(writer.width(), writer.height()))
        document.print_(writer)
        del writer
        write_beside(path, (beside.read_bytes(),), sync=True)
    finally:
        beside.unlink(missing_ok=True)


def _drawn(svg: str) -> QImage:
    renderer = QSvgRenderer(QByteArray(svg.encode("utf-8")))
    size = renderer.defaultSize()
    height = round(_WIDTH * size.height() / max(1, size.width()))
    image = QImage(round(_FINER * _WIDTH), round(_FINER * height), QImage.Format.Format_RGB32)
    image.fill(0xFFFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image
