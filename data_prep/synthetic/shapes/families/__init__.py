"""Object families, one module for each kind: animals, buildings, plants."""
