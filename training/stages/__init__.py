"""The stages of a training: which networks run, on what, and what is minimised."""
