"""The HTTP interface. FastAPI is imported in this folder alone."""
