"""Captures of synchronised camera rigs with LLFF poses, such as Neu3D."""
