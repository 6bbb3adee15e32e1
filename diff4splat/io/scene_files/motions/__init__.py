"""How each kind of motion is written and read, one file per kind."""
