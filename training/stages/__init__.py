"""Training stages: which networks run, on which input, and what is minimised."""
