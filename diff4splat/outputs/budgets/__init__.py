"""Tolerances, budgets and forecasts: what a command costs, and the cheapest setting that holds."""
