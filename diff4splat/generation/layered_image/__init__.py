"""An image as layers of colour, depth, mask and motion, and the Gaussians made of it."""
