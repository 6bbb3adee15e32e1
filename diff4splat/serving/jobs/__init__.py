"""Jobs: what was asked for, their states, and where their files lie."""
