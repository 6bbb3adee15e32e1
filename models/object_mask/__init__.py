"""Object mask: the pixels of what a prompt asks to move."""
