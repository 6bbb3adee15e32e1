"""Ray tracing of Gaussians: any rays in, colours and distances out."""
