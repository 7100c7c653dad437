from .csv_export import (
    export,
    export_laws,
    export_prediction,
    law_columns,
    motion_file_names,
    shot_columns,
    shot_row,
    write_motion,
    write_shots,
)
from .hdf5_export import export_hdf5
from .page import report_of
from .paper_rows import SECTIONS, cells, readable_unit, shown
from .pdf import document_of, write_pdf
from .provenance import program_words
from .session_section import shared_stds
from .shot_figures import contact_span_ms, time_zero

__all__ = [
    "SECTIONS",
    "cells",
    "contact_span_ms",
    "document_of",
    "export",
    "export_hdf5",
    "export_laws",
    "export_prediction",
    "law_columns",
    "motion_file_names",
    "program_words",
    "readable_unit",
    "report_of",
    "shared_stds",
    "shot_columns",
    "shot_row",
    "shown",
    "time_zero",
    "write_motion",
    "write_pdf",
    "write_shots",
]
