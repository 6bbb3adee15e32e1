"""Relative disparity to metric depth: fits, gates, references, files of other tools."""
