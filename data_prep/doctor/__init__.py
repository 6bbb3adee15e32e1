"""Proves that a copy of a data set is read as it was meant: comparisons, causes, a picture."""
