"""The back end on CUDA, by the package gsplat: what it can do, and images by it."""
