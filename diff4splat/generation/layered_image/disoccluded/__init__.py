"""The static layer behind what moves: its depth, its colours and their texture."""
