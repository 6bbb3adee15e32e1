"""One image, a camera path and optional text to a scene."""
