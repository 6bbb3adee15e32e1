"""Files: scenes, PLY, images, video, EXR. Outputs appear whole or not at all (``atomic``)."""
