"""Raw beats that another program stored: TDMS, HDF5, WAV, CSV, read by a mapping that is asked for once."""
