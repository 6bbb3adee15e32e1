"""Checks of the stability report, one file per group."""
