"""Other requests for the first image of a clip, for the motion network."""
