"""Public video models of the Wan family: their autoencoder, text encoder and weight names."""
