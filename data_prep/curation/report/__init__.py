"""The report of a curation as one HTML file."""
