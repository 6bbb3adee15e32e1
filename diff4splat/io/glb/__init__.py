"""glTF 2.0 in one binary file, with Gaussians (``KHR_gaussian_splatting``)."""
