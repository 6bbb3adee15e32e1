"""Which samples a step takes, and the processes that make them."""
