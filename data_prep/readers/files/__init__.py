"""Files that several formats share: images, depth maps, videos, JSON and point clouds."""
