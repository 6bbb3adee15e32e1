"""Depth that a request brings along: by a network of others, or as a map from any tool."""
