"""Forecasts of commands, and settings within a tolerance or a budget."""
