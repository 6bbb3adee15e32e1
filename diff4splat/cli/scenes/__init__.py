"""Commands that read a scene: render, bake, convert, export, view."""
