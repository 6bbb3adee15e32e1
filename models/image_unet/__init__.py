"""The U-Net of the networks that look at a single image."""
