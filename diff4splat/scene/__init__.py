"""The scene: Gaussians, a motion, suggested cameras and provenance."""
