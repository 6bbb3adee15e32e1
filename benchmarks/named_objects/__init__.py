"""Whether the named object of an image is found, any of them, in sentences never trained on."""
