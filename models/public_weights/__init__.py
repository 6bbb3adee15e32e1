"""Model folders that other projects publish: reading, checking, turning into one of ours."""
