"""Flow matching: path, levels, samplers and guidance. Knows no network, takes a callable."""
