"""Packets of rays through the hierarchy: candidates, intersections and sorted hits."""
