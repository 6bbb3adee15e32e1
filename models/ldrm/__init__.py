"""Latent Dynamic Reconstruction Model."""
