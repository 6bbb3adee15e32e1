"""What a generation is given: image, cameras, sizes."""
