"""The report as PDF: HTML laid out by Qt, with figures and legend keys drawn from SVG.

In a browser a figure takes its colours from the page's style sheet.  Qt draws each figure by itself and would fill all
shapes with black, so each gets the sheet's rules for figures, without variables, which Qt's SVG does not support.
"""

import os
import re
from functools import cache
from pathlib import Path

from PySide6.QtCore import QByteArray, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QGuiApplication, QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer

from app.report.svg_plot import WIDTH, style_sheet
from instrument.files import write_atomic

_FIGURE = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_KEY = re.compile(r'<span class="key ([\w-]+)">')
_WIDTH = 680  # width of a figure that spans the page, in the document's pixels
_KEY_SIZE = (26, 10)
_OVERSAMPLING = 3.0  # pixels of a figure per pixel of the document
_MARGIN_MM = 15.0
_RULE = re.compile(r"(?:svg |(?=\.series-))(\.?[\w-]+ \{[^{}]*\})")  # of a figure's elements, without "svg "
_VALUE = re.compile(r"(--[\w-]+): ([^;]+);")
_VARIABLE = re.compile(r"var\((--[\w-]+)\)")
NAMESPACE = "http://www.w3.org/2000/svg"


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
        """Draw a legend's key as an image, because the style sheet's border is not supported by Qt's rich text."""
        width, height = _KEY_SIZE
        shape = f"M0 {height / 2}H{width - 4}" if found[1] != "band" else f"M0 0H{width - 4}V{height}H0Z"
        svg = f'<svg viewBox="0 0 {width} {height}"><path class="{found[1]}" d="{shape}"/></svg>'
        return "&nbsp; " + added(f"key:{found[1]}", svg, width) + found[0]

    document.setHtml(_FIGURE.sub(pictured, _KEY.sub(with_key, html)))
    return document


def write_pdf(html: str, path: Path) -> None:
    """Write the report as a PDF of A4 pages.  Raises RecordingError."""
    application = QGuiApplication.instance()
    if application is None:  # fonts need an application object even without a display
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        application = QGuiApplication([])
    temporary = path.with_name(f".levimass-report.{os.getpid()}.new")
    try:
        writer = QPdfWriter(str(temporary))
        margins = QMarginsF(_MARGIN_MM, _MARGIN_MM, _MARGIN_MM, _MARGIN_MM)
        writer.setPageSize(QPageSize(QPageSize.PageSizeId.A4))
        writer.setPageMargins(margins, QPageLayout.Unit.Millimeter)
        writer.setResolution(96)
        document = document_of(html)
        document.setPageSize(QSizeF(writer.width(), writer.height()))
        document.print_(writer)
        del writer
        write_atomic(path, (temporary.read_bytes(),), sync=True)
    finally:
        temporary.unlink(missing_ok=True)


def _drawn(svg: str, width: float) -> QImage:
    """Return a figure as an image that keeps its width relative to the page."""
    head, _, elements = svg.partition(">")
    styled = f'{head} xmlns="{NAMESPACE}"><style>{figure_rules()}</style>{elements}'
    renderer = QSvgRenderer(QByteArray(styled.encode("utf-8")))
    size = renderer.defaultSize()
    narrower = width == _WIDTH and size.width() < WIDTH  # two side by side
    wide = 0.96 * width * size.width() / WIDTH if narrower else width
    height = wide * size.height() / max(1, size.width())
    image = QImage(round(_OVERSAMPLING * wide), round(_OVERSAMPLING * height), QImage.Format.Format_RGB32)
    image.fill(0xFFFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image


@cache
def figure_rules() -> str:
    """Return the style sheet's rules for the elements of figures, with variables replaced."""
    sheet = style_sheet()
    values = dict(_VALUE.findall(sheet))
    return _VARIABLE.sub(lambda found: values[found[1]], " ".join(_RULE.findall(sheet)))
