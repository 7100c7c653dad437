"""Reports and exports of shots as HTML, PDF, CSV and HDF5; only the PDF needs Qt."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
