"""The comparisons behind ``agreement``."""
