"""Settings of networks and of whole models."""
