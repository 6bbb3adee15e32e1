"""Latent video diffusion transformer."""
