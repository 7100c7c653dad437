"""The report as PDF: HTML laid out by Qt, with figures and legend keys drawn from SVG."""

import os
import re
from pathlib import Path

from PySide6.QtCore import QByteArray, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QGuiApplication, QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer

from app.report.svg_plot import WIDTH
from app.report.svg_style import with_own_style
from instrument.files import write_atomic

_FIGURE = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_KEY = re.compile(r'<span class="key ([\w-]+)">')
_WIDTH = 680  # of a figure over the page's width, in the document's pixels
_KEY_SIZE = (26, 10)
_OVERSAMPLING = 3.0  # a figure's pixels per pixel of the document
_MARGIN_MM = 15.0


def document_of(html: str) -> QTextDocument:
    """Return the report as a printable document; every inline figure becomes an image."""
    document = QTextDocument()

    def added(name: str, svg: str, width: float) -> str:
        image = _drawn(svg, width)
        document.addResource(QTextDocument.ResourceType.ImageResource.value, QUrl(name), image)
        size = (round(image.width() / _OVERSAMPLING), round(image.height() / _OVERSAMPLING))
        return f'<img src="{name}" width="{size[0]}" height="{size[1]}">'

    def pictured(found: re.Match[str]) -> str:
        return added(f"figure:{found.start()}", found[0], _WIDTH)

    def with_key(found: re.Match[str]) -> str:
        """Draw a legend's key: the style sheet makes it of a border, which Qt's text does not support."""
        width, height = _KEY_SIZE
        shape = f"M0 {height / 2}H{width - 4}" if found[1] != "band" else f"M0 0H{width - 4}V{height}H0Z"
        svg = f'<svg viewBox="0 0 {width} {height}"><path class="{found[1]}" d="{shape}"/></svg>'
        return "&nbsp; " + added(f"key:{found[1]}", svg, width) + found[0]

    document.setHtml(_FIGURE.sub(pictured, _KEY.sub(with_key, html)))
    return document


def write_pdf(html: str, path: Path) -> None:
    """Write the report as a PDF of A4 pages.  Raises RecordingError."""
    application = QGuiApplication.instance()
    if application is None:  # fonts need an application, also without a screen
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        application = QGuiApplication([])
    temporary = path.with_name(f".levimass-report.{os.getpid()}.new")
    try:
        writer = QPdfWriter(str(temporary))
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
        write_atomic(path, (temporary.read_bytes(),), sync=True)
    finally:
        temporary.unlink(missing_ok=True)


def _drawn(svg: str, width: float) -> QImage:
    """Return a figure as an image; the ratio of its width to the page's is kept."""
    renderer = QSvgRenderer(QByteArray(with_own_style(svg).encode("utf-8")))
    size = renderer.defaultSize()
    narrower = width == _WIDTH and size.width() < WIDTH  # two of them stand side by side
    wide = 0.96 * width * size.width() / WIDTH if narrower else width
    height = wide * size.height() / max(1, size.width())
    image = QImage(round(_OVERSAMPLING * wide), round(_OVERSAMPLING * height), QImage.Format.Format_RGB32)
    image.fill(0xFFFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image
