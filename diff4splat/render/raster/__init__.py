"""The CPU renderer: Numba kernels with explicit lanes, compiled on first use."""
