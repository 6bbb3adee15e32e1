"""Kernel toolkit: compilation, groups compiled ahead of use, SIMD values and threads."""
