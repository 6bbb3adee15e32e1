"""A public image classifier, which knows where an image may show what a prompt names."""
