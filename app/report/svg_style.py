"""SVG figures with the report's style sheet written into their elements' attributes.

In a page a figure takes its colours from the page's style sheet.  Qt draws it alone and knows neither the sheet nor its
variables, and would fill everything with black.
"""

import re
from functools import cache
from importlib import resources
from xml.etree import ElementTree

_RULE = re.compile(r"([^{}]+)\{([^{}]*)\}")
_VARIABLE = re.compile(r"var\((--[\w-]+)\)")
_SELECTOR = re.compile(r"(?:svg )?(\.?[\w-]+)$")
_PROPERTIES = ("fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linejoin", "text-anchor", "font-size")
NAMESPACE = "http://www.w3.org/2000/svg"

Style = dict[str, str]  # values by property


@cache
def style_sheet() -> str:
    """Return the style sheet of a report."""
    return resources.files("resources").joinpath("report.css").read_text(encoding="utf-8")


def rules_of(sheet: str) -> dict[str, Style]:
    """Return the rules of a style sheet for figures, by "name" or ".class", with variables replaced."""
    plain = re.sub(r"/\*.*?\*/|@media[^{]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}", "", sheet, flags=re.DOTALL)
    parsed = [(selectors.strip(), _declared(body)) for selectors, body in _RULE.findall(plain)]
    variables = {name: value for _, body in parsed for name, value in body.items() if name.startswith("--")}
    rules: dict[str, Style] = {}
    for selectors, body in parsed:
        style = {
            name: _VARIABLE.sub(lambda found: variables[found[1]], body[name]) for name in _PROPERTIES if name in body
        }
        for selector in selectors.split(","):
            found = _SELECTOR.match(selector.strip())
            if style and found is not None:
                rules.setdefault(found[1], {}).update(style)
    return rules


def with_own_style(svg: str, sheet: str | None = None) -> str:
    """Return a figure, an ``svg`` element, with the rules of ``sheet`` (the report's) as its elements' attributes."""
    rules = rules_of(style_sheet() if sheet is None else sheet)
    root = ElementTree.fromstring(svg)
    for element in root.iter():
        own: Style = {}
        for selector in (element.tag.rpartition("}")[2], *(f".{name}" for name in element.get("class", "").split())):
            own |= rules.get(selector, {})
        for name, value in own.items():
            element.set(name, value.removesuffix("px"))
    root.set("xmlns", NAMESPACE)
    return ElementTree.tostring(root, encoding="unicode")


def _declared(body: str) -> Style:
    pairs = (part.partition(":") for part in body.split(";") if ":" in part)
    return {name.strip(): value.strip() for name, _, value in pairs}
