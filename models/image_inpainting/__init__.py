"""A public image inpainting network, which continues photographs where nothing is known."""
