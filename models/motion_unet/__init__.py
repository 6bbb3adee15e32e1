"""Motion of the picture's own cells by a U-Net that reads the picture and the words (ours)."""
