"""Carries out one stage: steps, skips, averages, checkpoints, evaluation, on any process count."""
