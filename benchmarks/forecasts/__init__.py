"""Forecasts and limits against what commands take."""
