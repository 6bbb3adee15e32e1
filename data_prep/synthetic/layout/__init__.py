"""Where things stand: scene kinds, backdrops, and the space that motions and cameras need."""
