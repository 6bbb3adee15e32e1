"""Declarations of approximations, beside the code that they belong to."""
