"""Scores of clips, thresholds that are applied last, and the report on both."""
