"""The page of the stability report."""
