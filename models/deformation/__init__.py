"""Query-time deformation of canonical Gaussians."""
