"""Size, start and sorting of the viewer's page, in a real browser."""
