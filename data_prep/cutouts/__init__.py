"""Named cutouts, pasted over photographs: images that teach names of objects."""
