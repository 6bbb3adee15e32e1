"""Numbers of a scene as whole multiples of a step, compressed."""
