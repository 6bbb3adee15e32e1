"""Training on top of a network whose own weights stay as they are."""
