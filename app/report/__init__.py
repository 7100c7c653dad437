"""The printable report, piece by piece; ``app.report_page`` puts them together. No Qt: it needs no screen."""
