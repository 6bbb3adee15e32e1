"""The loss of one optimisation step."""
