"""Causal 3D video autoencoder."""
