"""Sizes of the cells of an image U-Net, for those who prepare its images and load no network."""

FOLDED_PX = 2
"""Pixels per side that become channels before the first convolution."""
LEVELS = 4
MULTIPLE_PX = FOLDED_PX << (LEVELS - 1)
"""Image sides must be multiples of it."""
