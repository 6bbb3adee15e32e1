"""Meshes made by people, with their textures: objects that no family of this project draws."""
