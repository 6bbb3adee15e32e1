"""Measurements of commands in processes of their own: calibration, and what runs leave out."""
