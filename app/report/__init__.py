"""Reports and exports of shots: HTML, PDF, CSV, HDF5; without Qt except the PDF."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
