"""Which tracks can be trusted, and tracks out of flow."""
