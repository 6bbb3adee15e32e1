"""One module per kind of stage, named as the kind is."""
