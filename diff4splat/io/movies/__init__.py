"""Moving images for people: H.264, VP9, GIF, WebP and numbered PNG files."""
