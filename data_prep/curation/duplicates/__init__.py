"""Clips that look alike: by perceptual hashes, and by features of images."""
