"""Benchmarks of scenes from true video."""
