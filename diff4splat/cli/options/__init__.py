"""Option groups that several commands share, and the objects they describe."""
