"""The video model, LDRM and the deformation network: from a video to Gaussians."""
