"""Motion prior: a U-Net from an image and text tokens to displacements and a mask."""
