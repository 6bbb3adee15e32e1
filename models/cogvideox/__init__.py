"""Public video models of the CogVideoX family: autoencoder, video model, text encoder, names."""
