"""What the checks look at: scenes, images, velocity fields, networks in a precision."""
