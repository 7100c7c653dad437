"""Raw beats in files of other programs: TDMS, HDF5, WAV, CSV, read by a saved mapping of their channels."""
