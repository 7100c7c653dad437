"""The report as pages: its HTML laid out by Qt, its figures and the keys of their legends drawn from SVG."""

import os
import re
from pathlib import Path

from PySide6.QtCore import QByteArray, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QGuiApplication, QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer

from app.report.svg_plot import WIDTH
from app.report.svg_style import with_own_style
from instrument.files.atomic_file import write_atomic

_FIGURE = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_KEY = re.compile(r'<span class="key ([\w-]+)">')
_WIDTH = 680  # of a figure over the page's width, in the document's pixels
_KEY_SIZE = (26, 10)
_FINER = 3.0  # than that a figure is drawn
_MARGIN_MM = 15.0


def document_of(html: str) -> QTextDocument:
    """Return the report as a document that prints; every inline figure becomes a picture of it."""
    document = QTextDocument()

    def added(name: str, svg: str, width: float) -> str:
        image = _drawn(svg, width)
        document.addResource(QTextDocument.ResourceType.ImageResource.value, QUrl(name), image)
        size = (round(image.width() / _FINER), round(image.height() / _FINER))
        return f'<img src="{name}" width="{size[0]}" height="{size[1]}">'

    def pictured(found: re.Match[str]) -> str:
        return added(f"figure:{found.start()}", found[0], _WIDTH)

    def with_key(found: re.Match[str]) -> str:
        """Draw a legend's key: the sheet makes it of a border before the words, which Qt's text does not know."""
        width, height = _KEY_SIZE
        shape = f"M0 {height / 2}H{width - 4}" if found[1] != "band" else f"M0 0H{width - 4}V{height}H0Z"
        svg = f'<svg viewBox="0 0 {width} {height}"><path class="{found[1]}" d="{shape}"/></svg>'
        return "&nbsp; " + added(f"key:{found[1]}", svg, width) + found[0]

    document.setHtml(_FIGURE.sub(pictured, _KEY.sub(with_key, html)))
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
        write_atomic(path, (beside.read_bytes(),), sync=True)
    finally:
        beside.unlink(missing_ok=True)


def _drawn(svg: str, width: float) -> QImage:
    """Return a figure; one that is narrower than the page stays narrower by as much."""
    renderer = QSvgRenderer(QByteArray(with_own_style(svg).encode("utf-8")))
    size = renderer.defaultSize()
    narrower = width == _WIDTH and size.width() < WIDTH  # two of them stand side by side
    wide = 0.96 * width * size.width() / WIDTH if narrower else width
    height = wide * size.height() / max(1, size.width())
    image = QImage(round(_FINER * wide), round(_FINER * height), QImage.Format.Format_RGB32)
    image.fill(0xFFFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image
