"""How long renderers take, and what the machine can do at most."""
