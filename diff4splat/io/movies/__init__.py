"""Moving images for people: H.264, VP9, VP8, GIF, WebP and numbered PNG files."""
