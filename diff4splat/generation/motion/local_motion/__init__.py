"""Motion of an object about itself: it rolls, spins, grows, bends."""
