"""Memory and seconds per step of a stage on GPUs, from counted operations."""
