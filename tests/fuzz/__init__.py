"""Damaged files for every reader, drawn by seed; ``make fuzz`` prints what becomes of them."""
