from .paper import PaperRow, Reproduction, Status, load, paper_rig, printed_value, reproduce, to_result
from .paper_figures import Curve, Figure, Row, figures

__all__ = [
    "Curve",
    "Figure",
    "PaperRow",
    "Reproduction",
    "Row",
    "Status",
    "figures",
    "load",
    "paper_rig",
    "printed_value",
    "reproduce",
    "to_result",
]
