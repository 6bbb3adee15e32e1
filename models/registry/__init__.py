"""Public weights by name: where they are, under which licence, and the copy in the cache."""
