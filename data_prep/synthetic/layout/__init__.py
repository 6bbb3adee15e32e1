"""Layout of a scene: kinds, backdrops, props and the free space for motions and cameras."""
