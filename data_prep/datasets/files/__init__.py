"""Files of data sets: 16-bit PNG, NumPy archives, HDF5, tar and tables of numbers."""
