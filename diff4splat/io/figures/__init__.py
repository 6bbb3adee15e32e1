"""Pages, plots and colour maps."""
