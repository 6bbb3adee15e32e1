"""Object families, as triangle meshes of unit height that stand on y = 0 and face +x."""
