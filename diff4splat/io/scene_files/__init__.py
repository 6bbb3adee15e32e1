"""The scene file and its parts."""
