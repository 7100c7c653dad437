from .exports import (
    export,
    export_hdf5,
    export_laws,
    export_prediction,
    law_columns,
    motion_file_names,
    shot_columns,
    shot_row,
    write_motion,
    write_table,
)
from .number_tables import PAPER_SECTIONS, fit_lines, paper_cells, readable_unit, shown_number, summary
from .page import report_of
from .pdf import document_of, write_pdf
from .provenance import program_words
from .session_section import shared_stds
from .shot_figures import contact_span_ms, deflection_of, grid_ms, time_zero

__all__ = [
    "PAPER_SECTIONS",
    "contact_span_ms",
    "deflection_of",
    "document_of",
    "export",
    "export_hdf5",
    "export_laws",
    "export_prediction",
    "fit_lines",
    "grid_ms",
    "law_columns",
    "motion_file_names",
    "paper_cells",
    "program_words",
    "readable_unit",
    "report_of",
    "shared_stds",
    "shot_columns",
    "shot_row",
    "shown_number",
    "summary",
    "time_zero",
    "write_motion",
    "write_pdf",
    "write_table",
]
