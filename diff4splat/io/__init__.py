"""Files: scenes, PLY, images, video, EXR. Outputs are written under a temporary name and renamed."""
