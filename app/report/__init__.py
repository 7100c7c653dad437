"""Reports and exports of shots: HTML, PDF, CSV, HDF5; without Qt except the PDF."""
